#pragma once

#include "ops/kernels/mpm/grid.hpp"
#include "ops/kernels/mpm/particle_chunk.hpp"
#include "ops/kernels/simd/dispatch.hpp"

namespace uniphy::kernels {

/// The inner loops of the MPM step, compiled for one instruction set. Each works on one chunk of
/// particles or on one layer of the grid; see the headers named for what they do.
template <class T>
struct MpmTable {
  using Chunk = TransferChunk<T>;
  using Constants = StepConstants<T>;

  // bspline.hpp, deformation_update.hpp
  void (*stencil)(const T* x, int count, const Constants&, Chunk*);
  void (*deformation_update)(const T* state, int count, const Constants&, T* F_trial);
  void (*deformation_update_adjoint)(const T* state, int count, const Constants&,
                                     const T* grad_F_trial, T* grad_C, T* grad_F);
  // p2g.hpp
  void (*p2g_records)(const T* state, const T* tau, const T* mass, const T* volume,
                      const Constants&, Chunk*);
  void (*scatter)(const Chunk&, const GridView<T>&, int layer_begin, int layer_end);
  // grid_update.hpp, grid_update_adjoint.hpp
  void (*grid_update)(const GridView<T>&, int layer, const LayerBox&, const Constants&);
  void (*grid_update_adjoint)(const GridView<const T>&, const GridView<T>& grad, int layer,
                              const LayerBox&, const Constants&);
  // g2p.hpp
  void (*gather)(const Chunk&, const GridView<const T>&, T* moments);
  void (*g2p_finish)(const Chunk&, const T* moments, const T* state, const Constants&,
                     T* state_out);
  // g2p_adjoint.hpp
  void (*g2p_adjoint_records)(const T* grad, const Constants&, Chunk*);
  void (*gather_slopes)(const Chunk&, const GridView<const T>&, T* moments);
  void (*g2p_adjoint_finish)(const Chunk&, const T* moments, const T* v_new, const Constants&,
                             T* grad);
  // p2g_adjoint.hpp
  void (*gather_adjoint)(const Chunk&, const GridView<const T>&, T* moments);
  void (*p2g_adjoint_finish)(const Chunk&, const T* moments, const T* mass, const T* volume,
                             const Constants&, T* grad, T* grad_tau);
};

inline constexpr int kGatherPlanes = 12;         ///< of `moments` in gather
inline constexpr int kGatherAdjointPlanes = 19;  ///< of `moments` in gather_adjoint, gather_slopes

UNIPHY_ISA_TABLE(MpmTable<float>)
UNIPHY_ISA_TABLE(MpmTable<double>)

/// The loops for an instruction set, the active one by default. Throws Error where it is not
/// available.
template <class T>
const MpmTable<T>& mpm_table(Isa isa = active_isa()) {
  return table_of<MpmTable<T>>(isa);
}

}  // namespace uniphy::kernels
