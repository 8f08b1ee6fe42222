#include "uniphy/inference/adaptation_options.hpp"

#include <algorithm>
#include <string>

namespace uniphy {

AdaptationOptions read_adaptation_options(Section& config) {
  AdaptationOptions o;
  Section s = config.section(
      "adaptation",
      "how far a learned law may leave the trained one; an analytic one has no rungs");
  const std::vector<std::string> names(std::begin(kRungNames), std::end(kRungNames));
  const auto chosen = s.choices(
      "rungs", names, names,
      "what may be free, upwards: z; and the biases of the last layers, the law's own numbers; and "
      "all weights. The fit climbs where the motion asks for it",
      between(1, 3));
  o.rungs.clear();
  for (const std::string& name : chosen) {
    const auto at = std::find(names.begin(), names.end(), name) - names.begin();
    o.rungs.push_back(static_cast<Rung>(at));
  }
  if (!config.describing() &&
      (o.rungs.front() != Rung::latent || !std::is_sorted(o.rungs.begin(), o.rungs.end()))) {
    s.fail("rungs", "expected latent first, then numbers, then weights, as far as they are given");
  }
  o.kept = s.real("kept", o.kept, Range{0, 0.9, true}, "",
                  "share of the time from first contact to the end that is kept from the fits and "
                  "decides between the rungs");
  o.gain = s.real("gain", o.gain, Range{0, 1, false, true}, "",
                  "share of the root error on the kept part that a rung has to take away to pay");
  o.enough = s.real("enough", o.enough, Range{0, 1, true}, "",
                    "root error over size, beside the noise, from which the fit climbs no further");
  o.tolerance =
      s.real("tolerance", o.tolerance, Range{0, 1, true}, "",
             "root error over size, beside the noise, from which the motion counts as not "
             "explained");
  o.iterations = static_cast<int>(
      s.integer("iterations", o.iterations, between(1, 1000), "",
                "of least squares (Levenberg-Marquardt) for z and the law's own numbers, at most; "
                "each takes a roll-out for every number"));
  o.epochs = static_cast<int>(s.integer("epochs", o.epochs, between(1, 100000), "",
                                        "roll-outs with gradients of all weights, at most"));
  o.optimizer = s.choice("optimizer", o.optimizer, {"lbfgs", "adamw"}, "of all weights");
  o.rate = s.real("rate", o.rate, Range{0, 1e3, true}, "",
                  "length of its first step (adamw: of every step, falling along a cosine)");
  o.pull = s.real("pull", o.pull, Range{0, 1e6}, "",
                  "adds pull |W - W0|^2 to mse/size^2 for all weights W but the law's own numbers");
  o.samples = static_cast<int>(
      s.integer("samples", o.samples, between(0, 100000), "",
                "laws drawn from the posterior, from which probabilities and intervals are taken, "
                "one to two roll-outs each; a multiple of 8. 0: none, and no intervals"));
  if (!config.describing() && o.samples % kPosteriorChains != 0) {
    s.fail("samples", "expected a multiple of 8, found " + std::to_string(o.samples));
  }
  return o;
}

}  // namespace uniphy
