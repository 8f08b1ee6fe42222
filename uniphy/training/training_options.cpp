#include "uniphy/training/training_options.hpp"

#include <fmt/format.h>

namespace uniphy {

TrainingOptions read_training_options(Section& config, const TrainingOptions& defaults,
                                      bool with_steps) {
  TrainingOptions options = defaults;
  Section model = config.section("model", "the form and size of the law");
  models::LearnedLawOptions& law = options.law;
  law.form = kernels::form_from_name(model.choice("form", kernels::form_name(law.form),
                                                  {"isotropic", "published"}, "form of the law"));
  law.activation = kernels::activation_from_name(
      model.choice("activation", kernels::activation_name(law.activation),
                   {"gelu", "silu", "squareplus"}, "of the hidden layers"));
  law.latent_size = model.integer("latent_size", law.latent_size, between(1, 256), "",
                                  "numbers in a latent code");
  if (law.latent_size < 2 && !config.describing()) {
    model.fail("latent_size", "expected 2 or more: the law takes its scales from two");
  }
  law.hidden_layers =
      model.integer("hidden_layers", law.hidden_layers, between(0, 16), "", "of each network");
  const auto answers_to_state = [&model](const char* key, bool state, const char* what) {
    return model.choice(key, state ? "state" : "constant", {"state", "constant"},
                        std::string("isotropic form: ") + what +
                            " as functions of the state and z, or of z alone") == "state";
  };
  law.state_caps = answers_to_state("caps", law.state_caps, "the caps of the projection");
  law.state_moduli = answers_to_state("moduli", law.state_moduli, "the moduli of the stress");
  law.width = model.integer("width", law.width, between(1, 1024), "", "of each hidden layer");

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
  read_loss_options(t, options.loss);
  if (options.loss.squared && law.form == kernels::LawForm::isotropic && !config.describing()) {
    t.fail("loss", "expected logarithm: form isotropic has no other loss");
  }
  options.clip = t.real("clip", options.clip, Range{0, 1e6, true}, "", "largest gradient norm");
  options.clip_each = t.boolean("clip_each", options.clip_each,
                                "of each of the two networks, not of both together");
  options.caps_share =
      t.real("caps_share", options.caps_share, between(0, 1), "",
             "of the steps, the first ones: the projection is judged as if it returned the whole "
             "way to its caps; then each trajectory may keep a share of its own");
  options.checkpoint_every =
      t.integer("checkpoint_every", options.checkpoint_every, at_least(1), "steps", "");
  return options;
}

std::string TrainingOptions::text() const {
  return fmt::format(
      "{} {} caps {} moduli {} latent {} layers {} width {} seed {} steps {} batch {} rate {} x {} "
      "decay {} sigma {} prior {} floor {} delta {} clip {} {} caps share {} squared {}",
      kernels::form_name(law.form), kernels::activation_name(law.activation), law.state_caps,
      law.state_moduli, law.latent_size, law.hidden_layers, law.width, seed, steps,
      batch_per_trajectory, learning_rate, latent_rate, weight_decay, loss.latent_sigma,
      loss.prior_weight, loss.error_floor, loss.delta, clip, clip_each, caps_share, loss.squared);
}

}  // namespace uniphy
