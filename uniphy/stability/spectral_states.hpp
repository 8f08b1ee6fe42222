#pragma once

#include <string>
#include <vector>

#include "uniphy/stability/stability_options.hpp"

namespace uniphy::stability {

/// Deformation gradients of one row of the matrix.
struct StateSet {
  std::string stressor;
  std::vector<double> F;  ///< [P, 9], row-major
  /// At rest and at rotations the strain is 0, the tip of sand's cone, where no derivative exists:
  /// sand gets these states compressed by kOffTheTip.
  bool at_tip = false;

  std::int64_t size() const { return static_cast<std::int64_t>(F.size() / 9); }
};
inline constexpr double kOffTheTip = 0.97;

/// U Σ Vᵀ with random rotations:
///   equal_values       Σ = (a, a, b) and (a, b, b), a in [1.1, 1.4], b in [0.6, 0.9]
///   near_equal_values  the same, the two apart by 1e-14 … 1e-2 (log-uniform)
///   at_rest            F = I
///   rotation           rotations by three angles in float32 arithmetic: FᵀF = I to 1e-7
///   near_rotation      Q (I + 1e-6 E), E with entries in [−1, 1]
///   rank_loss          (a, b, 0), one of four (a, 0, 0), and F = 0
///   inverted           (a, b, −c), c in [0.1, 0.5]: det F < 0
///   random_states      condition 1 … `condition` (log-uniform), largest value in [0.5, 2]
/// `spectral_states` in the last set, a hundredth (at least 100) in each other one but at_rest.
std::vector<StateSet> spectral_states(const StabilityOptions& options);

}  // namespace uniphy::stability
