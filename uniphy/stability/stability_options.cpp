#include "uniphy/stability/stability_options.hpp"

#include <algorithm>

#include "uniphy/stability/methods.hpp"

namespace uniphy::stability {

const std::vector<std::string>& stressor_groups() {
  static const std::vector<std::string> names{"spectral", "time_step", "impacts",
                                              "latents",  "horizons",  "precision"};
  return names;
}

bool StabilityOptions::has_method(const std::string& name) const {
  return std::find(methods.begin(), methods.end(), name) != methods.end();
}

StabilityOptions read_stability_options(Section& config) {
  StabilityOptions o;
  o.quick = config.boolean("quick", false, "within five minutes on two cores: smaller sizes");
  o.seed = static_cast<std::uint64_t>(
      config.integer("seed", 1, between(0, 9e15), "", "of all that is drawn"));
  o.model = config.input_file("model", "models/pretrained/unified.h5",
                              "the trained law of the isotropic form, with codes of the families");
  o.stressors = config.choices("stressors", stressor_groups(), stressor_groups(),
                               "which groups of rows", at_least(1));
  std::vector<std::string> methods;
  for (const Method& m : kMethods) methods.emplace_back(m.name);
  o.methods = config.choices("methods", methods, methods, "which columns", at_least(1));

  Section spectral = config.section("spectral", "gradients at and near equal singular values");
  o.spectral_states = spectral.integer("states", o.quick ? 10000 : 1000000, between(10, 1e8), "",
                                       "random F; a hundredth of it at every other point");
  o.spectral_condition = spectral.real("condition", 1e8, between(1, 1e12), "",
                                       "largest condition number of a random F");
  Section rollout = config.section("rollout", "time steps, impacts and latents");
  o.steps = rollout.integer("steps", o.quick ? 300 : 2000, between(1, 1e7), "", "of each");
  o.per_side = rollout.integer("per_side", 10, between(2, 200), "",
                               "particles along half a metre of a body; 10 are one a cell");
  o.drawn = rollout.integer("drawn", o.quick ? 2 : 10, between(1, 1000), "",
                            "random codes and perturbed networks, of every kind and family");
  Section horizons = config.section("horizons", "gradients of long roll-outs");
  o.horizons =
      horizons.integers("steps",
                        o.quick ? std::vector<std::int64_t>{100, 300, 1000}
                                : std::vector<std::int64_t>{100, 300, 1000, 3000, 10000, 20000},
                        between(1, 1e6), "", "of the roll-outs", between(1, 20));
  Section precision = config.section("precision", "float32 against float64");
  o.drift_steps =
      precision.integer("steps", o.quick ? 500 : 2000, between(1, 1e7), "", "of the roll-outs");
  return o;
}

}  // namespace uniphy::stability
