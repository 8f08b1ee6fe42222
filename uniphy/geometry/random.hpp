#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>

namespace uniphy {

/// Uniform numbers that are the same on every platform: the bits of std::mt19937_64 are fixed by
/// the standard, the distributions of <random> are not, so the mapping is done here.
class UniformRandom {
 public:
  explicit UniformRandom(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1), a multiple of 2⁻⁵³.
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * unit(); }
  /// exp of a uniform number between the logarithms; 0 < low ≤ high.
  double log_between(double low, double high) {
    return low * std::exp(std::log(high / low) * unit());
  }
  /// In 0 … count − 1.
  std::size_t below(std::size_t count) {
    return static_cast<std::size_t>(unit() * static_cast<double>(count));
  }
  /// In the box from low to high, x drawn first.
  Eigen::Vector3d in_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    Eigen::Vector3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = between(low[axis], high[axis]);
    return p;
  }
  /// A unit vector, uniform on the sphere (rejection from the cube, no trigonometry).
  Eigen::Vector3d direction() {
    for (;;) {
      const Eigen::Vector3d p = in_box(Eigen::Vector3d::Constant(-1), Eigen::Vector3d::Constant(1));
      const double square = p.squaredNorm();
      if (square > 1e-4 && square <= 1) return p / std::sqrt(square);
    }
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace uniphy
