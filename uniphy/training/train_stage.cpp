#include "uniphy/training/train_stage.hpp"

#include <ATen/Parallel.h>

#include <memory>

#include "uniphy/training/heldout_fit.hpp"
#include "uniphy/training/training_options.hpp"
#include "uniphy/training/training_report.hpp"

namespace uniphy {
namespace {

struct TrainStageOptions {
  std::filesystem::path data, heldout;
  TrainingOptions training;
  LatentFitOptions fit;
};

TrainStageOptions read(Section& config) {
  TrainStageOptions o;
  o.data = config.input_file("data", required, "data set of uniphy_generate");
  o.heldout = config.input_file("heldout", "", "data set for the held-out errors, or none");

  o.training = read_training_options(config, {}, true);
  o.fit = read_latent_fit_options(config);
  o.fit.error_floor = o.training.error_floor;
  o.fit.delta = o.training.delta;
  o.fit.latent_sigma = o.training.latent_sigma;
  return o;
}

}  // namespace

RunFunction train_stage(Section& config) {
  const TrainStageOptions o = read(config);
  return [o](RunDirectory& out, Metrics& metrics) {
    at::set_num_threads(out.threads());
    const Dataset data = read_dataset(o.data);
    Dataset heldout;
    if (!o.heldout.empty()) heldout = read_dataset(o.heldout);
    const TrainingResult result =
        train(data, o.training, out.file("checkpoint.pt"), o.heldout.empty() ? nullptr : &heldout);
    metrics.set("train_s", result.seconds);
    metrics.set("parameters", double(result.networks.parameter_count()));
    metrics.set("loss", result.history.back().loss);
    write_model(out.file("model.h5"),
                model_file(result.networks, result.z, data, out.config_yaml()), true);
    write_training_curves(out, result.history);
    plot_latents(out, result.z, data);
    const auto weights = std::make_shared<kernels::LearnedLawWeights>(result.networks.weights());
    report_law_errors(data, law_errors(data, weights, numbers_of(result.z)), "train.", metrics);
    if (!o.heldout.empty()) {
      const HeldoutFit fit = fit_heldout(heldout, result.networks, result.z, weights, o.fit);
      report_law_errors(heldout, fit.errors, "heldout.", metrics);
    }
  };
}

}  // namespace uniphy
