#include "uniphy/evaluation/ablation_options.hpp"

#include <fmt/format.h>

#include <set>

#include "uniphy/io/plain_name.hpp"

namespace uniphy {
namespace {

void read_variants(Section& config, const TrainingOptions& base, AblationOptions& o) {
  std::set<std::string> names;
  for (Section& s : config.list("variants", "the laws that are compared", at_least(1))) {
    AblationVariant v;
    v.name = s.text("name", required, "of the row and of the folder");
    if (!s.describing() && !(is_plain_name(v.name) && v.name != "data")) {
      s.fail("name", fmt::format("expected letters, digits, _, - and . (no dot first, not data), "
                                 "found \"{}\"",
                                 v.name));
    }
    if (!s.describing() && !names.insert(v.name).second) {
      s.fail("name", fmt::format("expected names that differ, found \"{}\" twice", v.name));
    }
    v.group = s.text("group", "", "what is varied: variants of a group share a line of the charts");
    v.trajectories = s.integer("trajectories", o.draw.trajectories, between(1, 100000), "",
                               "of each material in the training set");
    GenerateOptions set = o.draw;
    read_random_laws(s, set);
    v.random_laws = set.random_laws;
    v.training = read_training_options(s, base, false);
    o.variants.push_back(v);
  }
}

}  // namespace

AblationOptions read_ablation_options(Section& config) {
  AblationOptions o;
  o.draw.seed = static_cast<std::uint64_t>(
      config.integer("seed", 1, between(0, 9e15), "", "of the training and the held-out sets"));
  read_draw_options(config, o.draw);
  o.heldout_trajectories =
      config.integer("heldout_trajectories", o.heldout_trajectories, between(1, 100000), "",
                     "of each material in heldout_all");
  TrainingOptions base;
  Section budget = config.section("budget", "of every variant alike");
  budget.variant("type", std::string("steps"),
                 {{"steps", "optimizer steps",
                   [&](Section& s) {
                     base.steps = s.integer("steps", 6000, at_least(1), "", "of every variant");
                   }},
                  {"seconds", "as many steps as a short trial finds room for",
                   [&](Section& s) {
                     o.budget_seconds =
                         s.real("seconds", 180, positive(), "s", "training time of every variant");
                   }}},
                 "what is the same for all");
  base = read_training_options(config, base, false);
  o.fit = read_latent_fit_options(config, false);
  read_variants(config, base, o);
  return o;
}

GenerateOptions AblationOptions::training_set(const AblationVariant& v) const {
  GenerateOptions set = draw;
  set.split = Split::train;
  set.trajectories = v.trajectories;
  set.random_laws = v.random_laws;
  return set;
}

std::string AblationOptions::settings_of(const AblationVariant& v) const {
  const std::string budget = budget_seconds ? fmt::format("budget {} s\n", *budget_seconds) : "";
  return fmt::format("{}\n{}fit: starts {}, steps {}, rate {}\nheld out {}\n", v.training.text(),
                     budget, fit.starts, fit.steps, fit.learning_rate, heldout_trajectories) +
         generate_config(training_set(v));
}

}  // namespace uniphy
