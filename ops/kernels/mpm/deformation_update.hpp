#pragma once

// The trial deformation gradient F_trial = (I + Δt C) F of a chunk, and its adjoint:
//   dL/dF = (I + Δt C)ᵀ G,   dL/dC = Δt G Fᵀ   with G = dL/dF_trial.

#include "ops/kernels/mpm/p2g.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// C and F are taken from the state planes; F_trial [9] planes.
template <class T>
void deformation_update(const T* state, int count, const StepConstants<T>& constants, T* F_trial) {
  using V = Lanes<T>;
  const V dt(constants.dt);
  for (int l = 0; l < count; l += width_of<V>) {
    V F[9];
    for (int k = 0; k < 9; ++k) F[k] = load_plane<V>(state, kPlaneF + k, l);
    for (int a = 0; a < 3; ++a) {
      V C[3];
      for (int c = 0; c < 3; ++c) C[c] = load_plane<V>(state, kPlaneC + 3 * a + c, l);
      for (int b = 0; b < 3; ++b) {
        const V CF = lane_fma(C[0], F[b], lane_fma(C[1], F[3 + b], C[2] * F[6 + b]));
        store_plane<V>(F_trial, 3 * a + b, l, lane_fma(dt, CF, F[3 * a + b]));
      }
    }
  }
}

/// Overwrites grad_F and adds to grad_C; planes [9] each. grad_F may be grad_F_trial.
template <class T>
void deformation_update_adjoint(const T* state, int count, const StepConstants<T>& constants,
                                const T* grad_F_trial, T* grad_C, T* grad_F) {
  using V = Lanes<T>;
  const V dt(constants.dt);
  for (int l = 0; l < count; l += width_of<V>) {
    V F[9], C[9], G[9];
    for (int k = 0; k < 9; ++k) {
      F[k] = load_plane<V>(state, kPlaneF + k, l);
      C[k] = load_plane<V>(state, kPlaneC + k, l);
      G[k] = load_plane<V>(grad_F_trial, k, l);
    }
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const V CtG = lane_fma(C[a], G[b], lane_fma(C[3 + a], G[3 + b], C[6 + a] * G[6 + b]));
        store_plane<V>(grad_F, 3 * a + b, l, lane_fma(dt, CtG, G[3 * a + b]));
        const V GFt = lane_fma(G[3 * a], F[3 * b],
                               lane_fma(G[3 * a + 1], F[3 * b + 1], G[3 * a + 2] * F[3 * b + 2]));
        store_plane<V>(grad_C, 3 * a + b, l,
                       lane_fma(dt, GFt, load_plane<V>(grad_C, 3 * a + b, l)));
      }
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
