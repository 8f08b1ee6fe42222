#include "uniphy/training/heldout_fit.hpp"

namespace uniphy {

HeldoutFit fit_heldout(const Dataset& data, const LawColumns& columns,
                       const models::TrainedModel& model,
                       const std::shared_ptr<const kernels::LearnedLawWeights>& weights,
                       const LatentFitOptions& options) {
  HeldoutFit fit;
  fit.latents = numbers_of(fit_latents(columns, model, options));
  fit.errors = law_errors(data, weights, fit.latents);
  return fit;
}

std::vector<double> numbers_of(const torch::Tensor& tensor) {
  const torch::Tensor flat = tensor.detach().to(torch::kFloat64).contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

}  // namespace uniphy
