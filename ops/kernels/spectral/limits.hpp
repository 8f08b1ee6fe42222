#pragma once

// The limits of the spectral functions, in one place for kernels, exports and references.

namespace uniphy::kernels {

/// Singular values are clamped here before the logarithm: part of the definition of the plastic
/// materials (UniPhy, CVPR 2025), and kept by the learned law.
inline constexpr double kMinimumStretch = 0.05;

/// Sums σi + σj are divided by no smaller than this. They vanish for singular and inverted F alone:
/// two values that small at once, or σ3 = −σ2, where the rotation jumps.
inline constexpr double kLeastSum = 1e-5;

/// |γ x| and |δ x| of a strain measure end here: e^(2·30) = 1e26, and float does not overflow.
inline constexpr double kArgumentLimit = 30;

}  // namespace uniphy::kernels
