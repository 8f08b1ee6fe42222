#pragma once

#include <optional>
#include <string>
#include <vector>

#include "uniphy/config/config.hpp"
#include "uniphy/data/generate_options.hpp"
#include "uniphy/training/latent_fit.hpp"
#include "uniphy/training/training_options.hpp"

namespace uniphy {

/// One law of an ablation.
struct AblationVariant {
  std::string name;               ///< letters, digits, '_', '-', '.': the folder of what is kept
  std::string group;              ///< what it varies: a line of the charts
  std::int64_t trajectories = 0;  ///< of each material in its training set
  std::array<std::int64_t, 3> random_laws{};  ///< beside them, see GenerateOptions
  TrainingOptions training;                   ///< steps are those of the budget
};

/// What uniphy_ablate works on. Every variant gets the same budget.
struct AblationOptions {
  GenerateOptions draw;  ///< seed, and everything but split, trajectories and random_laws
  std::int64_t heldout_trajectories = 8;
  std::optional<double> budget_seconds;  ///< of training; none: training.steps optimizer steps
  LatentFitOptions fit;
  std::vector<AblationVariant> variants;

  /// How the training set of a variant is drawn.
  GenerateOptions training_set(const AblationVariant& variant) const;
  /// Everything that the result of a variant depends on, as text, a line a part.
  std::string settings_of(const AblationVariant& variant) const;
};

/// Declares and reads all keys. The sections `model` and `training` and the key `trajectories` are
/// the defaults of the same keys in each of `variants`.
AblationOptions read_ablation_options(Section& config);

}  // namespace uniphy
