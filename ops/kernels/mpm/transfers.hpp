#pragma once

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::kernels {

// The three parts of an MPM step one by one, on row-major arrays in the user's order: what the
// autograd wrappers call. Whole roll-outs go through Rollout, which keeps everything in place
// between the parts. Grids are [n,n,n,4] (momentum, mass) or [n,n,n,3] (velocity); particles x, v
// [P,3], C, tau [P,9], mass, volume [P]. Units and formulas: p2g.hpp, grid_update.hpp, g2p.hpp.
// The same bits on any number of threads. A stencil that leaves the grid, or a mass or volume that
// is not positive, is an Error that names the particle. Null pointers among gradients mean absent
// (inputs) or not wanted (outputs); outputs are overwritten.

template <class T>
struct ParticleArrays {
  std::ptrdiff_t count;
  const T *x, *v, *C, *tau, *mass, *volume;
};
template <class T>
struct ParticleGradients {
  T *x, *v, *C, *tau, *mass, *volume;
};

template <class T>
void p2g(const GridSettings& settings, const ParticleArrays<T>& particles, T* grid);
template <class T>
void p2g_adjoint(const GridSettings& settings, const ParticleArrays<T>& particles,
                 const T* grad_grid, const ParticleGradients<T>& grad);

template <class T>
void grid_update(const GridSettings& settings, const T* grid, T* velocity);
/// velocity is what grid_update made of grid.
template <class T>
void grid_update_adjoint(const GridSettings& settings, const T* grid, const T* velocity,
                         const T* grad_velocity, T* grad_grid);

/// x_out, v_out [P,3], C_out [P,9].
template <class T>
void g2p(const GridSettings& settings, std::ptrdiff_t count, const T* x, const T* velocity,
         T* x_out, T* v_out, T* C_out);
/// v_out is what g2p returned.
template <class T>
void g2p_adjoint(const GridSettings& settings, std::ptrdiff_t count, const T* x, const T* velocity,
                 const T* v_out, const T* grad_x_out, const T* grad_v_out, const T* grad_C_out,
                 T* grad_x, T* grad_velocity);

}  // namespace uniphy::kernels
