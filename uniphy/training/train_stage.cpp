#include "uniphy/training/train_stage.hpp"

#include <ATen/Parallel.h>

#include <cstdio>
#include <memory>

#include "uniphy/training/heldout_fit.hpp"
#include "uniphy/training/trained_model_file.hpp"
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
  o.fit = read_latent_fit_options(config, false);
  o.fit.loss = o.training.loss;
  return o;
}

}  // namespace

RunFunction train_stage(Section& config) {
  const TrainStageOptions o = read(config);
  return [o](RunDirectory& out, Metrics& metrics) {
    at::set_num_threads(out.threads());
    const Dataset data = read_dataset(o.data);
    Dataset heldout;
    LawColumns heldout_columns;
    if (!o.heldout.empty()) {
      heldout = read_dataset(o.heldout);
      heldout_columns = law_columns(heldout, o.training.law.form);
    }
    const TrainingResult result = train(data, o.training, out.file("checkpoint.pt"),
                                        o.heldout.empty() ? nullptr : &heldout_columns);
    const models::TrainedModel& model = result.model;
    metrics.set("train_s", result.seconds);
    metrics.set("parameters", double(model.law->parameter_count()));
    metrics.set("loss", result.history.back().loss);
    write_model(out.file("model.h5"), model_file(model, out.config_yaml(), time_steps(data)), true);
    write_training_curves(out, result.history);
    plot_latents(out, model.codes);
    const auto weights = std::make_shared<kernels::LearnedLawWeights>(model.law->weights());
    report_law_errors(data, law_errors(data, weights, numbers_of(model.codes->z)), "train.",
                      metrics);
    if (!o.heldout.empty()) {
      const HeldoutFit fit = fit_heldout(heldout, heldout_columns, model, weights, o.fit);
      report_law_errors(heldout, fit.errors, "heldout.", metrics);
    }
    std::printf("a law of %lld parameters and %lld codes after %lld steps, loss %.4g\n",
                static_cast<long long>(model.law->parameter_count()),
                static_cast<long long>(data.trajectories.size()),
                static_cast<long long>(o.training.steps), result.history.back().loss);
  };
}

}  // namespace uniphy
