#pragma once

#include <vector>

#include "uniphy/inference/rigid_motion.hpp"

namespace uniphy {

/// The state of a body at the first frame as a fit describes it. Of degree 0, that of a body that
/// is undeformed and moves as a rigid one: C = 0, F = I. Of degree d > 0, with r = x − centre and
/// m_k the monomials of r/radius up to degree d,
///   v = linear + angular × r + D r + Σ b_k m_k (of degree 2 and more),   C = ∇v,
///   F = exp(Σ H_k m_k),   D and H_k symmetric:
/// of an isotropic law the rotation in F does not matter, so that F is its left stretch.
struct InitialState : RigidMotion {
  InitialState() = default;
  /// Of degree 0. Explicit: a state that is passed on as its rigid motion would lose the rest.
  explicit InitialState(const RigidMotion& motion) : RigidMotion(motion) {}

  int degree = 0;
  double radius = 1;  ///< m
  /// [initial_numbers(degree) − 6] beside the rigid motion: D as xx, yy, zz, xy, xz, yz (1/s), b_k
  /// (m/s), H_k as D.
  std::vector<double> numbers;
};

/// Monomials of three coordinates up to a degree.
int monomial_count(int degree);
/// Numbers of a state: the rigid motion's six and the others.
int initial_numbers(int degree);
/// Those of its velocity alone, which come first.
int velocity_numbers(int degree);

}  // namespace uniphy
