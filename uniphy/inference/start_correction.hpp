#pragma once

#include <torch/types.h>

#include "uniphy/inference/fit_problem.hpp"

namespace uniphy {

/// What observed positions say about where each point was at the first frame, of which one noisy
/// position is known: a start that is off by δ moves the point's whole path by G δ, G = dx/dx₀ the
/// gradient of the flow. Of residuals r = x̂ − x the least squares solution of every point,
///   δ = −(Σ GᵀG)⁻¹ Σ Gᵀ r   over the frames that show it,
/// corrects its start, and r + G δ is what remains of them, with the starts eliminated: the
/// variables that all points share are fitted to that (variable projection; G. Golub and V.
/// Pereyra, SIAM J. Numer. Anal. 10, 1973).
class StartCorrection {
 public:
  /// G [frames, points, 3, 3] of a law near the one looked for; hidden [frames, 3 points], or
  /// undefined.
  StartCorrection(const torch::Tensor& flow_gradients, const torch::Tensor& hidden);

  /// What remains of the residuals r [frames, 3 points], 0 where hidden, of as many frames.
  torch::Tensor remaining(const torch::Tensor& r) const;
  /// δ [points, 3] of such residuals, m.
  torch::Tensor correction(const torch::Tensor& r) const;

 private:
  torch::Tensor G_;        ///< [points, 3 frames, 3], 0 where hidden
  torch::Tensor inverse_;  ///< [points, 3, 3] (Σ GᵀG)⁻¹
};

/// The observation with the starts of its points moved by δ [points, 3], and particles that are
/// points with them; kept within the unit cube.
Observation with_corrected_starts(const Observation& observation, const torch::Tensor& delta);

/// The observation with a start for every point. A point that the first frame hides is traced back
/// from the first one that shows it, by the rigid motion of free flight; those that are first seen
/// after the contact are left out. Throws Error, starting with `name`, where none is left.
Observation with_known_starts(const Observation& observation, const std::string& name);

}  // namespace uniphy
