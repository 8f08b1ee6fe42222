#include "uniphy/training/train_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/training/law_error.hpp"
#include "uniphy/training/trainer.hpp"

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

  Section model = config.section("model", "the form and size of the law");
  NetworkOptions& network = o.training.network;
  network.form = kernels::form_from_name(
      model.choice("form", "isotropic", {"isotropic", "seed"}, "form of the law"));
  network.activation = kernels::activation_from_name(
      model.choice("activation", "silu", {"gelu", "silu", "squareplus"}, "of the hidden layers"));
  network.latent_size =
      model.integer("latent_size", 8, between(1, 256), "", "numbers in a latent code");
  network.hidden_layers = model.integer("hidden_layers", 3, between(0, 16), "", "of each network");
  const auto answers_to = [&model](const char* key, const char* what) {
    return model.choice(key, "constant", {"state", "constant"},
                        std::string("of the isotropic form: ") + what +
                            " as functions of the state and z, or of z alone") == "state";
  };
  network.state_caps = answers_to("caps", "the caps of the projection");
  network.state_moduli = answers_to("moduli", "the moduli of the stress");
  network.width = model.integer("width", 32, between(1, 1024), "", "of each hidden layer");

  Section t = config.section("training", "AdamW on all trajectories at once");
  TrainingOptions& options = o.training;
  options.seed = std::uint64_t(t.integer("seed", 1, at_least(0), "", "of weights and batches"));
  options.steps = t.integer("steps", options.steps, at_least(1), "", "optimizer steps");
  options.batch_per_trajectory =
      t.integer("batch_per_trajectory", options.batch_per_trajectory, between(1, 65536), "samples",
                "of every trajectory in a step");
  options.learning_rate = t.real("learning_rate", options.learning_rate, positive(), "",
                                 "of the networks; falls to zero along a cosine");
  options.latent_rate =
      t.real("latent_rate", options.latent_rate, positive(), "", "times learning_rate, for z");
  options.weight_decay = t.real("weight_decay", options.weight_decay, at_least(0), "", "of AdamW");
  options.latent_sigma =
      t.real("latent_sigma", options.latent_sigma, positive(), "", "width of the prior of z");
  options.error_floor = t.real("error_floor", options.error_floor, positive(), "",
                               "errors are relative to a sample's own size plus this share of "
                               "the trajectory's RMS");
  options.delta = t.real("delta", options.delta, positive(), "",
                         "squared relative error below which the logarithm is linear");
  options.clip = t.real("clip", options.clip, positive(), "", "largest gradient norm");
  options.checkpoint_every =
      t.integer("checkpoint_every", options.checkpoint_every, at_least(1), "steps", "");

  Section fit = config.section("fit", "latents of the held-out trajectories");
  o.fit.starts = fit.integer("starts", o.fit.starts, between(1, 64), "", "training codes to try");
  o.fit.steps = fit.integer("steps", o.fit.steps, at_least(1), "", "optimizer steps");
  o.fit.learning_rate = fit.real("learning_rate", o.fit.learning_rate, positive(), "", "of z");
  o.fit.error_floor = options.error_floor;
  o.fit.delta = options.delta;
  o.fit.latent_sigma = options.latent_sigma;
  return o;
}

std::vector<double> numbers(const torch::Tensor& t) {
  const torch::Tensor flat = t.detach().to(torch::kFloat64).contiguous();
  return {flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel()};
}

void write_curves(const RunDirectory& out, const std::vector<TrainingPoint>& history) {
  std::string csv = "step,loss,stress_error,projection_error\n";
  Series loss{"loss", {}, {}, {}, false}, stress{"stress error", {}, {}, {}, false},
      projection{"projection error", {}, {}, {}, false};
  for (const TrainingPoint& p : history) {
    csv += fmt::format("{},{:.9g},{:.9g},{:.9g}\n", p.step, p.loss, p.stress_error,
                       p.projection_error);
    for (Series* s : {&loss, &stress, &projection}) s->x.push_back(double(p.step));
    loss.y.push_back(p.loss);
    stress.y.push_back(p.stress_error);
    projection.y.push_back(p.projection_error);
  }
  write_text_file(out.file("history.csv"), csv);
  Chart chart;
  chart.title = "Training (medians over trajectories)";
  chart.x_label = "step";
  chart.y_label = "relative error";
  chart.log_y = true;
  chart.series = {loss, stress, projection};
  plot_chart(out.file("training.png"), chart);
}

/// Codes in their first two principal components, a series a material.
void write_latents(const RunDirectory& out, const torch::Tensor& z, const Dataset& data) {
  const torch::Tensor x = z.detach().to(torch::kFloat64);
  const torch::Tensor centred = x - x.mean(0, true);
  if (centred.size(1) < 2 || centred.size(0) < 2) return;
  const torch::Tensor axes = std::get<1>(torch::linalg_eigh(centred.t().mm(centred)));
  const torch::Tensor plane = centred.mm(axes.narrow(1, axes.size(1) - 2, 2)).contiguous();
  const double* at = plane.data_ptr<double>();
  Chart chart;
  chart.title = "Latent codes";
  chart.x_label = "first principal component";
  chart.y_label = "second";
  for (std::size_t i = 0; i < data.trajectories.size(); ++i) {
    const std::string& material = data.trajectories[i].material;
    if (chart.series.empty() || chart.series.back().label != material) {
      chart.series.push_back({material, {}, {}, {}, true});
    }
    chart.series.back().x.push_back(at[2 * i + 1]);
    chart.series.back().y.push_back(at[2 * i]);
  }
  plot_chart(out.file("latents.png"), chart);
}

}  // namespace

RunFunction train_stage(Section& config) {
  const TrainStageOptions o = read(config);
  return [o](RunDirectory& out, Metrics& metrics) {
    at::set_num_threads(out.threads());
    const Dataset data = read_dataset(o.data);
    const auto start = std::chrono::steady_clock::now();
    const TrainingResult result = train(data, o.training, out.file("checkpoint.pt"));
    metrics.set("train_s",
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    metrics.set("parameters", double(result.networks.parameter_count()));
    metrics.set("loss", result.history.back().loss);
    write_model(out.file("model.h5"),
                model_file(result.networks, result.z, data, out.config_yaml()), true);
    write_curves(out, result.history);
    write_latents(out, result.z, data);
    const auto weights = std::make_shared<kernels::LearnedLawWeights>(result.networks.weights());
    report_law_errors(data, law_errors(data, weights, numbers(result.z)), "train.", metrics);
    if (!o.heldout.empty()) {
      const Dataset heldout = read_dataset(o.heldout);
      const torch::Tensor z = fit_latents(heldout, result.networks, result.z, o.fit);
      report_law_errors(heldout, law_errors(heldout, weights, numbers(z)), "heldout.", metrics);
    }
  };
}

}  // namespace uniphy
