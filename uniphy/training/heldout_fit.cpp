#include "uniphy/training/heldout_fit.hpp"

namespace uniphy {

HeldoutFit fit_heldout(const Dataset& data, const Networks& networks,
                       const torch::Tensor& training_z,
                       const std::shared_ptr<const kernels::LearnedLawWeights>& weights,
                       const LatentFitOptions& options) {
  HeldoutFit fit;
  fit.latents = numbers_of(fit_latents(data, networks, training_z, options));
  fit.errors = law_errors(data, weights, fit.latents);
  return fit;
}

LatentFitOptions read_latent_fit_options(Section& config) {
  Section fit = config.section("fit", "latents of the held-out trajectories");
  LatentFitOptions o;
  o.starts = fit.integer("starts", o.starts, between(1, 64), "", "training codes to try");
  o.steps = fit.integer("steps", o.steps, at_least(1), "", "optimizer steps");
  o.learning_rate = fit.real("learning_rate", o.learning_rate, Range{0, 1e3, true}, "", "of z");
  return o;
}

std::vector<double> numbers_of(const torch::Tensor& tensor) {
  const torch::Tensor flat = tensor.detach().to(torch::kFloat64).contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

}  // namespace uniphy
