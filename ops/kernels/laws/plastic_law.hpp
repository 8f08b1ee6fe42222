#pragma once

#include "ops/kernels/laws/hencky.hpp"
#include "ops/kernels/laws/particle_memory.hpp"
#include "ops/kernels/laws/return_map.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// A return mapping, Mapping::{map, adjoint}, with the StVK-Hencky stress. F and F_proj share U and
/// V, and log Σ' comes out of the mapping, so that evaluate and adjoint need one SVD and no second
/// logarithm. Particles that do not yield keep the bits of F, and of dL/dF_proj on the way back.
/// MemoryOf is what it remembers (particle_memory.hpp).
template <class Mapping, template <class> class MemoryOf = NoMemory>
struct PlasticLaw {
  using Stress = Hencky;
  template <class V>
  using Memory = MemoryOf<V>;

  /// F_proj = U exp(scale ε̂ + trace/3) Vᵀ where the lane yields.
  template <class V>
  static UNIPHY_INLINE Mat3<V> project(const Mat3<V>& F, const Material<V>& m, Memory<V>& memory) {
    const Svd3<V> s = svd3(F);
    HenckyStrain<V> h = hencky_strain(s.sigma, false);
    memory.shift(h);
    const ReturnMap<V> r = Mapping::map(h, m);
    const MaskOf<V> moves = memory.moves(r.yields);
    if (!any<V>(moves)) return F;
    const LogMap<V> y = log_map(h, r.scale, r.trace);
    return select3(moves, compose(s.U, y.sigma, s.V_), F);
  }

  template <class V>
  static UNIPHY_INLINE Mat3<V> project_adjoint(const Mat3<V>& F, const Material<V>& m,
                                               const Mat3<V>& grad, MaterialGradient<V>& g,
                                               Memory<V>& memory) {
    const Svd3<V> s = svd3(F);
    HenckyStrain<V> h = hencky_strain(s.sigma, true);
    memory.shift(h);
    const ReturnMap<V> r = Mapping::map(h, m);
    const MaskOf<V> moves = memory.moves(r.yields);
    if (!Memory<V>::kKept && !any<V>(moves)) return grad;
    const LogMap<V> y = log_map(h, r.scale, r.trace);
    const Mat3<V> A = mul(tmul(s.U, grad), s.V_);
    const Mat3<V> B = map_adjoint(s.sigma, h, m, r, y, A, g, memory);
    return select3(moves, mult(mul(s.U, B), s.V_), grad);
  }

  template <class V>
  static UNIPHY_INLINE void evaluate(const Mat3<V>& F, const Mat3<V>& /*C*/, const Material<V>& m,
                                     Mat3<V>& F_proj, Mat3<V>& tau, Memory<V>& memory) {
    const Svd3<V> s = svd3(F);
    HenckyStrain<V> h = hencky_strain(s.sigma, false);
    memory.shift(h);
    const ReturnMap<V> r = Mapping::map(h, m);
    const MaskOf<V> moves = memory.moves(r.yields);
    F_proj = F;
    if (any<V>(moves)) {
      const LogMap<V> y = log_map(h, r.scale, r.trace);
      F_proj = select3(moves, compose(s.U, y.sigma, s.V_), F);
      for (int i = 0; i < 3; ++i) h.eps[i] = select<V>(moves, y.log_sigma[i], h.eps[i]);
    }
    tau = hencky_stress(s.U, h.eps, r.trace, m);
  }

  template <class V>
  static UNIPHY_INLINE Mat3<V> adjoint(const Mat3<V>& F, const Mat3<V>& /*C*/, const Material<V>& m,
                                       const Mat3<V>& grad_F_proj, const Mat3<V>& grad_tau,
                                       Mat3<V>& /*grad_C*/, MaterialGradient<V>& g,
                                       Memory<V>& memory) {
    using T = ScalarOf<V>;
    const V zero(T(0)), one(T(1));
    const Svd3<V> s = svd3(F);
    HenckyStrain<V> h = hencky_strain(s.sigma, true);
    memory.shift(h);
    const ReturnMap<V> r = Mapping::map(h, m);
    const MaskOf<V> moves = memory.moves(r.yields);
    const Mat3<V> S = mul(tmul(s.U, sym(grad_tau)), s.U);
    StressState<V> state{s.sigma, h.eps, r.trace, h.slope, h.divided};
    if (!Memory<V>::kKept && !any<V>(moves)) {
      return grad_F_proj + mult(mul(s.U, hencky_adjoint(state, S, m, g)), s.V_);
    }
    const LogMap<V> y = log_map(h, r.scale, r.trace);
    for (int i = 0; i < 3; ++i) {
      const int a = kPair[i][0], b = kPair[i][1];
      state.sigma[i] = select<V>(moves, y.sigma[i], s.sigma[i]);
      state.eps[i] = select<V>(moves, y.log_sigma[i], h.eps[i]);
      state.slope[i] = select<V>(moves, one / y.sigma[i], h.slope[i]);
      state.divided[i] = select<V>(
          moves, log_divided_difference(y.sigma[a], y.sigma[b], y.log_sigma[a], y.log_sigma[b]),
          h.divided[i]);
    }
    const Mat3<V> of_stress = hencky_adjoint(state, S, m, g);
    const Mat3<V> A = mul(tmul(s.U, grad_F_proj), s.V_) + of_stress;
    const Mat3<V> B = select3(moves, map_adjoint(s.sigma, h, m, r, y, A, g, memory), of_stress);
    Mat3<V> grad = mult(mul(s.U, B), s.V_);
    for (int k = 0; k < 9; ++k) {
      grad.e[k] = grad.e[k] + select<V>(moves, zero, grad_F_proj.e[k]);
    }
    return grad;
  }

 private:
  /// dL/dF in the frame from A = Uᵀ (dL/dF_proj) V; right on lanes that move only, and parameters
  /// gather from those that yield alone.
  template <class V>
  static UNIPHY_INLINE Mat3<V> map_adjoint(const Vec3<V>& sigma, const HenckyStrain<V>& h,
                                           const Material<V>& m, const ReturnMap<V>& r,
                                           const LogMap<V>& y, const Mat3<V>& A,
                                           MaterialGradient<V>& g, Memory<V>& memory) {
    const V zero(ScalarOf<V>(0));
    V grad_scale, grad_trace;
    StrainGradient<V> strain{{}, zero};
    Mat3<V> B = log_map_adjoint(h, sigma, y, A, grad_scale, grad_trace, strain.deviator);
    Mapping::adjoint(h, m, r, select<V>(r.yields, grad_scale, zero),
                     select<V>(r.yields, grad_trace, zero), strain, g);
    memory.adjoint(h, r, grad_trace, strain);
    add_strain_gradient(h, strain.deviator, strain.trace, B);
    return B;
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
