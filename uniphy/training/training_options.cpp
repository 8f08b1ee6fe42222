#include "uniphy/training/training_options.hpp"

namespace uniphy {

TrainingOptions read_training_options(Section& config, const TrainingOptions& defaults,
                                      bool with_steps) {
  TrainingOptions options = defaults;
  Section model = config.section("model", "the form and size of the law");
  NetworkOptions& network = options.network;
  network.form = kernels::form_from_name(model.choice(
      "form", kernels::form_name(network.form), {"isotropic", "published"}, "form of the law"));
  network.activation = kernels::activation_from_name(
      model.choice("activation", kernels::activation_name(network.activation),
                   {"gelu", "silu", "squareplus"}, "of the hidden layers"));
  network.latent_size = model.integer("latent_size", network.latent_size, between(1, 256), "",
                                      "numbers in a latent code");
  if (network.form == kernels::LawForm::isotropic && network.latent_size < 2 &&
      !config.describing()) {
    model.fail("latent_size", "expected 2 or more: form isotropic takes its scales from two");
  }
  network.hidden_layers =
      model.integer("hidden_layers", network.hidden_layers, between(0, 16), "", "of each network");
  const auto answers_to_state = [&model](const char* key, bool state, const char* what) {
    return model.choice(key, state ? "state" : "constant", {"state", "constant"},
                        std::string("isotropic form: ") + what +
                            " as functions of the state and z, or of z alone") == "state";
  };
  network.state_caps = answers_to_state("caps", network.state_caps, "the caps of the projection");
  network.state_moduli =
      answers_to_state("moduli", network.state_moduli, "the moduli of the stress");
  network.width =
      model.integer("width", network.width, between(1, 1024), "", "of each hidden layer");

  Section t = config.section("training", "AdamW on all trajectories at once");
  options.seed = std::uint64_t(
      t.integer("seed", std::int64_t(options.seed), at_least(0), "", "of weights and batches"));
  if (with_steps)
    options.steps = t.integer("steps", options.steps, at_least(1), "", "optimizer steps");
  options.batch_per_trajectory =
      t.integer("batch_per_trajectory", options.batch_per_trajectory, between(1, 65536), "samples",
                "of every trajectory in a step");
  options.learning_rate = t.real("learning_rate", options.learning_rate, Range{0, 1, true}, "",
                                 "of the networks; falls to zero along a cosine");
  options.latent_rate = t.real("latent_rate", options.latent_rate, Range{0, 1e6, true}, "",
                               "times learning_rate, for z");
  options.weight_decay =
      t.real("weight_decay", options.weight_decay, between(0, 100), "", "of AdamW");
  options.latent_sigma =
      t.real("latent_sigma", options.latent_sigma, Range{1e-6, 1e6}, "", "width of the prior of z");
  options.error_floor = t.real("error_floor", options.error_floor, Range{0, 1e6, true}, "",
                               "errors are relative to a sample's own size plus this share of "
                               "the trajectory's RMS");
  options.delta = t.real("delta", options.delta, Range{1e-12, 1e12}, "",
                         "squared relative error below which the logarithm is linear");
  options.clip = t.real("clip", options.clip, Range{0, 1e6, true}, "", "largest gradient norm");
  options.checkpoint_every =
      t.integer("checkpoint_every", options.checkpoint_every, at_least(1), "steps", "");
  return options;
}

}  // namespace uniphy
