#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/config/config.hpp"

namespace uniphy::stability {

struct StabilityOptions {
  bool quick = false;
  std::uint64_t seed = 1;
  std::filesystem::path model;         ///< the trained isotropic law
  std::vector<std::string> stressors;  ///< groups of rows
  std::vector<std::string> methods;

  std::int64_t spectral_states = 0;  ///< random F
  double spectral_condition = 0;     ///< their largest condition number
  std::int64_t steps = 0;            ///< of a roll-out
  std::int64_t per_side = 0;         ///< particles along the side of a body
  std::int64_t drawn = 0;            ///< random codes and perturbations a family
  std::vector<std::int64_t> horizons;
  std::int64_t drift_steps = 0;

  bool has_method(const std::string& name) const;
};

/// The groups of rows, in the order that they are measured in.
const std::vector<std::string>& stressor_groups();

/// Declares and reads the keys of uniphy_stability.
StabilityOptions read_stability_options(Section& config);

}  // namespace uniphy::stability
