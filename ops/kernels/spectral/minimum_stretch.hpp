#pragma once

namespace uniphy::kernels {

/// Singular values are clamped here before the logarithm.
inline constexpr double kMinimumStretch = 0.05;

}  // namespace uniphy::kernels
