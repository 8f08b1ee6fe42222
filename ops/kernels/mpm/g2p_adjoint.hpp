#pragma once

#include "ops/kernels/mpm/p2g_adjoint.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

// The adjoint of G2P, given g_x, g_v, g_C at the new state. With ĝ = g_v + Δt g_x,
//   dL/dv_n = Σ_p w_np (ĝ + (4/Δx²) g_C (x_n − x_p)),
// which is a scatter of the form of P2G: g2p_adjoint_records writes its records. What reaches the
// old position comes through the weights and through x_n − x_p: gather_adjoint<true> on the grid of
// velocities, then g2p_adjoint_finish.

/// The records of the scatter. `grad` are state planes, dL/d(new state).
template <class T>
void g2p_adjoint_records(const T* grad, const StepConstants<T>& constants,
                         TransferChunk<T>* chunk) {
  using V = Lanes<T>;
  const V dt(constants.dt), factor(4 * constants.inv_dx);
  for (int l = 0; l < chunk->count; l += width_of<V>) {
    V q[3], a[9];
    for (int c = 0; c < 3; ++c) {
      q[c] = lane_fma(dt, load_plane<V>(grad, kPlaneX + c, l), load_plane<V>(grad, kPlaneV + c, l));
    }
    for (int k = 0; k < 9; ++k) a[k] = factor * load_plane<V>(grad, kPlaneC + k, l);
    store_records(chunk, l, q, a, V(T(0)));
  }
}

/// Turns `grad` from dL/d(new state) into the part of dL/d(old state) that comes through G2P: x is
/// added to, C is cleared. v_new are the three planes of the new velocity.
template <class T>
void g2p_adjoint_finish(const TransferChunk<T>& chunk, const T* moments, const T* v_new,
                        const StepConstants<T>& constants, T* grad) {
  using V = Lanes<T>;
  const V inv_dx(constants.inv_dx), factor(4 * constants.inv_dx);
  for (int l = 0; l < chunk.count; l += width_of<V>) {
    for (int b = 0; b < 3; ++b) {
      V through_offset(T(0));
      for (int c = 0; c < 3; ++c) {
        const int k = kPlaneC + 3 * c + b;
        through_offset += load_plane<V>(grad, k, l) * load_plane<V>(v_new, c, l);
        store_plane<V>(grad, k, l, V(T(0)));
      }
      const V g_f = load_plane<V>(moments, 16 + b, l) - factor * through_offset;
      const int k = kPlaneX + b;
      store_plane<V>(grad, k, l, lane_fma(g_f, inv_dx, load_plane<V>(grad, k, l)));
    }
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
