#pragma once

#include "ops/kernels/laws/material.hpp"
#include "ops/kernels/laws/particle_memory.hpp"
#include "ops/kernels/laws/volumetric.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// A law whose projection needs no singular values: Projection::{project, adjoint} followed by
/// Stress::{stress, stress_adjoint}. All functions take one matrix per lane.
template <class Projection, class StressLaw>
struct DirectLaw {
  using Stress = StressLaw;
  template <class V>
  using Memory = NoMemory<V>;

  template <class V>
  static UNIPHY_INLINE Mat3<V> project(const Mat3<V>& F, const Material<V>& /*m*/,
                                       NoMemory<V>& /*memory*/) {
    return Projection::project(F);
  }
  template <class V>
  static UNIPHY_INLINE Mat3<V> project_adjoint(const Mat3<V>& F, const Material<V>& /*m*/,
                                               const Mat3<V>& grad, MaterialGradient<V>& /*g*/,
                                               NoMemory<V>& /*memory*/) {
    return Projection::adjoint(F, grad);
  }
  template <class V>
  static UNIPHY_INLINE void evaluate(const Mat3<V>& F, const Mat3<V>& C, const Material<V>& m,
                                     Mat3<V>& F_proj, Mat3<V>& tau, NoMemory<V>& /*memory*/) {
    F_proj = Projection::project(F);
    tau = Stress::stress(F_proj, C, m);
  }
  template <class V>
  static UNIPHY_INLINE Mat3<V> adjoint(const Mat3<V>& F, const Mat3<V>& C, const Material<V>& m,
                                       const Mat3<V>& grad_F_proj, const Mat3<V>& grad_tau,
                                       Mat3<V>& grad_C, MaterialGradient<V>& g,
                                       NoMemory<V>& /*memory*/) {
    const Mat3<V> through_tau =
        Stress::stress_adjoint(Projection::project(F), C, m, grad_tau, grad_C, g);
    return Projection::adjoint(F, grad_F_proj + through_tau);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
