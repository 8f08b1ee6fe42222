#pragma once

#include "ops/kernels/laws/material.hpp"
#include "ops/kernels/spectral/spectral.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// What a yield criterion decides about one strain: whether it yields and, where it does, the
/// projected logarithms log Σ' = scale · ε̂ + trace/3. Lanes that do not yield hold scale 1 and the
/// trace as it was.
template <class V>
struct ReturnMap {
  MaskOf<V> yields;
  V scale;
  V trace;
};

/// dL/d(strain) gathered on the way back: through ε̂ and through tr ε.
template <class V>
struct StrainGradient {
  Vec3<V> deviator;
  V trace;

  /// Adds w times dq, q = ‖ε̂‖, i.e. w ε̂/q; nothing where q is 0.
  UNIPHY_INLINE void add_norm(const HenckyStrain<V>& h, const V& w) {
    using T = ScalarOf<V>;
    const V c = w / select<V>(h.norm > V(T(0)), h.norm, V(T(1)));
    for (int i = 0; i < 3; ++i) deviator[i] = lane_fma(c, h.deviator[i], deviator[i]);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
