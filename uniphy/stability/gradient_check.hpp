#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>

#include "uniphy/stability/spectral_states.hpp"
#include "uniphy/stability/stability_cell.hpp"

namespace uniphy::stability {

/// F [P, 3, 3] → a function of each state, [P, N], of order one, float64.
using StateFunction = std::function<torch::Tensor(const torch::Tensor& F)>;

/// How a gradient is judged.
struct GradientCheck {
  StateFunction function;  ///< the method: differentiable by autograd
  /// What its values are to be: differentiated by central differences, without autograd. The
  /// forward computation of an isotropic function is good to rounding at equal singular values, and
  /// the function is smooth there, so that its differences are right where formulas in U and V are
  /// not.
  StateFunction reference;
  /// In place of it where the derivative is known in closed form: F, dL/d(function) → dL/dF.
  std::function<torch::Tensor(const torch::Tensor& F, const torch::Tensor& grad)> exact;
  bool zero_not_finite = false;  ///< as nan_to_zero does
  std::uint64_t seed = 1;        ///< of dL/d(function), uniform in [−1, 1]
};

/// Compares dL/dF of every state with the reference, L a random linear function of the outputs.
/// Central differences of fourth order with h and h/2,
///   h = 1e-3 min(0.1, |σ2 + σ3|),
/// since isotropic functions bend on the scale of σ2 + σ3, the denominator of their rotation part.
/// A state has a derivative where both agree to 1e-6 of its norm (at least 1e-3). States with
/// |σ2 + σ3| ≤ 1e-5 (kLeastSum), whose rotation jumps, are judged by finiteness alone.
/// Sets gradient_error (largest), gradient_error_median, gradient_error_together (‖g −
/// g_ref‖/‖g_ref‖ of all states as one vector), finite_share, derivative_share, left_out_share,
/// gradient_max, states, zeroed (entries), verdict and failure (particle: the row).
void check_gradients(const std::vector<double>& F, const GradientCheck& check, Cell& cell);

/// dL/dF of R = U Vᵀ from G = dL/dR, without singular vectors: with the stretch S = Rᵀ F and
/// M = tr(S) I − S,  dL/dF = 2 R [M⁻¹ a]×,  a the axial vector of ½ (RᵀG − GᵀR). det F > 0; F, G
/// [P, 3, 3]. R by Newton's iteration in long double. It follows from the skew part of RᵀdF =
/// Ω S + dS. N. Higham, Functions of Matrices, section 8.
torch::Tensor polar_rotation_gradient(const torch::Tensor& F, const torch::Tensor& G);

}  // namespace uniphy::stability
