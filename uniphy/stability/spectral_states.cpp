#include "uniphy/stability/spectral_states.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "uniphy/geometry/random.hpp"

namespace uniphy::stability {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d rotation(UniformRandom& random) {
  const Vector3d axis = random.direction();
  return Eigen::AngleAxisd(random.between(-3.1, 3.1), axis).toRotationMatrix();
}

/// By three angles, in float32 arithmetic: a rotation to 1e-7.
Eigen::Matrix3f single_rotation(UniformRandom& random) {
  Eigen::Matrix3f R = Eigen::Matrix3f::Identity();
  for (int axis = 0; axis < 3; ++axis) {
    const auto angle = static_cast<float>(random.between(-3.1, 3.1));
    R = (R * Eigen::AngleAxisf(angle, Eigen::Vector3f::Unit(axis)).toRotationMatrix()).eval();
  }
  return R;
}

Matrix3d with_values(UniformRandom& random, const Vector3d& values) {
  const Matrix3d U = rotation(random), V = rotation(random);
  return U * values.asDiagonal() * V.transpose();
}

void append(const Matrix3d& F, std::vector<double>& to) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) to.push_back(F(i, j));
  }
}

template <class Make>
StateSet make_set(const char* name, std::int64_t count, const Make& make, bool at_tip = false) {
  StateSet set{name, {}, at_tip};
  set.F.reserve(static_cast<std::size_t>(9 * count));
  for (std::int64_t i = 0; i < count; ++i) append(make(i), set.F);
  return set;
}

}  // namespace

std::vector<StateSet> spectral_states(const StabilityOptions& o) {
  UniformRandom random(o.seed);
  const std::int64_t some = std::max<std::int64_t>(o.spectral_states / 100, 100);
  const auto pair = [&](std::int64_t i, double gap) {
    const double a = random.between(1.1, 1.4), b = random.between(0.6, 0.9);
    return with_values(random, i % 2 == 0 ? Vector3d(a, a - gap, b) : Vector3d(a, b, b - gap));
  };
  std::vector<StateSet> sets;
  sets.push_back(make_set("equal_values", some, [&](std::int64_t i) { return pair(i, 0); }));
  sets.push_back(make_set("near_equal_values", some, [&](std::int64_t i) {
    return pair(i, random.log_between(1e-14, 1e-2));
  }));
  sets.push_back(make_set(
      "at_rest", 1, [](std::int64_t) { return Matrix3d(Matrix3d::Identity()); }, true));
  sets.push_back(make_set(
      "rotation", some, [&](std::int64_t) { return single_rotation(random).cast<double>().eval(); },
      true));
  sets.push_back(make_set(
      "near_rotation", some,
      [&](std::int64_t) {
        const Matrix3d Q = rotation(random);
        Matrix3d E;
        for (int k = 0; k < 9; ++k) E(k / 3, k % 3) = random.between(-1, 1);
        return Matrix3d(Q * (Matrix3d::Identity() + 1e-6 * E));
      },
      true));
  sets.push_back(make_set("rank_loss", some, [&](std::int64_t i) {
    if (i == 0) return Matrix3d(Matrix3d::Zero());
    const double a = random.between(1.1, 1.4), b = random.between(0.6, 0.9);
    return with_values(random, Vector3d(a, i % 4 == 3 ? 0 : b, 0));
  }));
  sets.push_back(make_set("inverted", some, [&](std::int64_t) {
    const double a = random.between(1.1, 1.4), b = random.between(0.6, 0.9);
    return with_values(random, Vector3d(a, b, -random.between(0.1, 0.5)));
  }));
  sets.push_back(make_set("random_states", o.spectral_states, [&](std::int64_t) {
    const double top = random.between(0.5, 2);
    const double least = top / random.log_between(1, o.spectral_condition);
    return with_values(random, Vector3d(top, random.log_between(least, top), least));
  }));
  return sets;
}

}  // namespace uniphy::stability
