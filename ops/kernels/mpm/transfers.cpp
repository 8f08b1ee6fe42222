#include "ops/kernels/mpm/transfers.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "ops/kernels/base/check_positive.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/mpm/grid_plan.hpp"
#include "ops/kernels/mpm/mpm_table.hpp"
#include "ops/kernels/mpm/particle_order.hpp"
#include "ops/kernels/simd/aligned_buffer.hpp"

namespace uniphy::kernels {
namespace {

/// Layers are handed to threads in this many contiguous parts of about equal work. The bits of a
/// sum do not depend on it (p2g.hpp); no more threads than this take part.
constexpr int kLayerParts = 16;

/// The particles of one call in chunks, with their stencils, and a grid with the rows padded as the
/// kernels want them.
template <class T>
class Transfer {
 public:
  Transfer(const GridSettings& settings, std::ptrdiff_t count, const T* x)
      : constants((settings.check(), settings)),
        order({{0, count}}),
        table(mpm_table<T>()),
        transfer(chunks()),
        state(chunks() * std::ptrdiff_t(kStateChunkSize)),
        nodes(grid_size(settings.n)),
        grid(grid_view(nodes.data(), settings.n)) {
    order.sort(x, settings.n);
    state.fill(T(0));
    transfer.fill(TransferChunk<T>{});
    load(x, 3, kPlaneX);
    for_chunks([&](int c) { table.stencil(planes(c), order.count(c), constants, &transfer[c]); });
    throw_if_outside(settings, x);
    plan.build(transfer.data(), chunks(), settings.n);
  }

  int chunks() const { return order.chunks(); }
  T* planes(int chunk) { return state.data() + chunk * std::ptrdiff_t(kStateChunkSize); }
  GridView<const T> const_grid() const { return {grid.data, grid.row_stride, grid.layer_stride}; }

  /// Absent rows read as zero.
  void load(const T* rows, int width, int plane) {
    if (rows != nullptr) order.load(rows, width, planes(0) + plane * kChunk, kStateChunkSize);
  }
  AlignedBuffer<T> load(const T* rows, int width) const {
    AlignedBuffer<T> planes(chunks() * std::ptrdiff_t(width) * kChunk);
    if (rows != nullptr) {
      order.load(rows, width, planes.data(), width * kChunk);
    } else {
      planes.fill(T(0));
    }
    return planes;
  }
  void store(int width, int plane, T* rows) const {
    if (rows != nullptr) {
      order.store(state.data() + plane * kChunk, kStateChunkSize, width, rows);
    }
  }

  template <class Visit>
  void for_chunks(const Visit& visit) const {
#pragma omp parallel for schedule(static)
    for (int c = 0; c < chunks(); ++c) visit(c);
  }

  /// The sum of all records, as [n,n,n,width] numbers.
  void scatter_all(int width, T* out) {
    const int n = constants.n;
#pragma omp parallel for schedule(dynamic)
    for (int part = 0; part < kLayerParts; ++part) {
      const int begin = plan.cut(part, kLayerParts), end = plan.cut(part + 1, kLayerParts);
      if (begin >= end) continue;
      for (int i = begin; i < end; ++i) clear_layer(grid, i, plan.box(i));
      for (int c = 0; c < chunks(); ++c) table.scatter(transfer[c], grid, begin, end);
    }
    std::fill_n(out, std::ptrdiff_t(n) * n * n * width, T(0));
    copy_box(width, [&](T* node, std::ptrdiff_t at) { std::copy_n(node, width, out + at); });
  }
  /// Takes over the touched part of [n,n,n,width] numbers.
  void take_grid(const T* from, int width) {
    for (int i = plan.layer_begin(); i < plan.layer_end(); ++i) {
      clear_layer(grid, i, plan.box(i));
    }
    copy_box(width, [&](T* node, std::ptrdiff_t at) { std::copy_n(from + at, width, node); });
  }

  const StepConstants<T> constants;
  ParticleOrder order;
  const MpmTable<T>& table;
  AlignedBuffer<TransferChunk<T>> transfer;
  AlignedBuffer<T> state;  ///< planes as in particle_chunk.hpp
  AlignedBuffer<T> nodes;
  const GridView<T> grid;
  GridPlan plan;

 private:
  template <class Copy>
  void copy_box(int width, const Copy& copy) {
    const std::ptrdiff_t n = constants.n;
    for (int i = plan.layer_begin(); i < plan.layer_end(); ++i) {
      const LayerBox& box = plan.box(i);
      for (int j = box.y_begin; j < box.y_end; ++j) {
        for (int k = box.z_begin; k < box.z_end; ++k) {
          copy(grid.data + i * grid.layer_stride + j * grid.row_stride + k * std::ptrdiff_t(4),
               ((i * n + j) * n + k) * width);
        }
      }
    }
  }

  void throw_if_outside(const GridSettings& settings, const T* x) const {
    std::ptrdiff_t lost = -1;
    for (int c = 0; c < chunks(); ++c) {
      if (transfer[c].bad < 0) continue;
      const std::ptrdiff_t p = order.particles_of(c)[transfer[c].bad];
      if (lost < 0 || p < lost) lost = p;
    }
    if (lost < 0) return;
    char text[256];
    std::snprintf(text, sizeof(text),
                  "particle %td at (%.6g, %.6g, %.6g) m: its stencil leaves the grid; expected "
                  "positions in [%.6g, %.6g) m",
                  lost, double(x[3 * lost]), double(x[3 * lost + 1]), double(x[3 * lost + 2]),
                  0.5 * settings.dx(), 1 - 1.5 * settings.dx());
    throw Error(text);
  }
};

}  // namespace

template <class T>
void p2g(const GridSettings& settings, const ParticleArrays<T>& p, T* grid) {
  check_positive("p2g", "mass", p.mass, 0, p.count);
  check_positive("p2g", "volume", p.volume, 0, p.count);
  Transfer<T> t(settings, p.count, p.x);
  t.load(p.v, 3, kPlaneV);
  t.load(p.C, 9, kPlaneC);
  const auto tau = t.load(p.tau, 9), mass = t.load(p.mass, 1), volume = t.load(p.volume, 1);
  t.for_chunks([&](int c) {
    t.table.p2g_records(t.planes(c), tau.data() + c * kMatrixChunkSize, mass.data() + c * kChunk,
                        volume.data() + c * kChunk, t.constants, &t.transfer[c]);
  });
  t.scatter_all(4, grid);
}

template <class T>
void p2g_adjoint(const GridSettings& settings, const ParticleArrays<T>& p, const T* grad_grid,
                 const ParticleGradients<T>& grad) {
  Transfer<T> t(settings, p.count, p.x);
  t.load(p.v, 3, kPlaneV);
  t.load(p.C, 9, kPlaneC);
  auto tau = t.load(p.tau, 9), mass = t.load(p.mass, 1), volume = t.load(p.volume, 1);
  t.take_grid(grad_grid, 4);
  t.for_chunks([&](int c) {
    alignas(64) T moments[kGatherAdjointPlanes * kChunk];
    alignas(64) T g[kStateChunkSize] = {}, g_tau[kMatrixChunkSize];
    T* state = t.planes(c);
    T* stress = tau.data() + c * kMatrixChunkSize;
    T* m = mass.data() + c * kChunk;
    T* V = volume.data() + c * kChunk;
    t.table.p2g_records(state, stress, m, V, t.constants, &t.transfer[c]);
    t.table.gather_adjoint(t.transfer[c], t.const_grid(), moments);
    t.table.p2g_adjoint_finish(t.transfer[c], moments, m, V, t.constants, g, g_tau);
    for (int l = 0; l < t.order.count(c); ++l) {
      // Momentum is linear in m and in V₀ τ, so both follow from the gradients of v, C and τ.
      T by_mass = 0, by_volume = 0;
      for (int k = kPlaneV; k < kPlaneF; ++k) by_mass += g[k * kChunk + l] * state[k * kChunk + l];
      for (int k = 0; k < 9; ++k) by_volume += g_tau[k * kChunk + l] * stress[k * kChunk + l];
      m[l] = by_mass / m[l] + moments[3 * kChunk + l];
      V[l] = by_volume / V[l];
    }
    std::copy(g, g + kPlaneF * kChunk, state);
    std::copy(g_tau, g_tau + kMatrixChunkSize, stress);
  });
  t.store(3, kPlaneX, grad.x);
  t.store(3, kPlaneV, grad.v);
  t.store(9, kPlaneC, grad.C);
  if (grad.tau != nullptr) t.order.store(tau.data(), kMatrixChunkSize, 9, grad.tau);
  if (grad.mass != nullptr) t.order.store(mass.data(), kChunk, 1, grad.mass);
  if (grad.volume != nullptr) t.order.store(volume.data(), kChunk, 1, grad.volume);
}

template <class T>
void g2p(const GridSettings& settings, std::ptrdiff_t count, const T* x, const T* velocity,
         T* x_out, T* v_out, T* C_out) {
  Transfer<T> t(settings, count, x);
  t.take_grid(velocity, 3);
  t.for_chunks([&](int c) {
    alignas(64) T moments[kGatherPlanes * kChunk];
    t.table.gather(t.transfer[c], t.const_grid(), moments);
    t.table.g2p_finish(t.transfer[c], moments, t.planes(c), t.constants, t.planes(c));
  });
  t.store(3, kPlaneX, x_out);
  t.store(3, kPlaneV, v_out);
  t.store(9, kPlaneC, C_out);
}

template <class T>
void g2p_adjoint(const GridSettings& settings, std::ptrdiff_t count, const T* x, const T* velocity,
                 const T* v_out, const T* grad_x_out, const T* grad_v_out, const T* grad_C_out,
                 T* grad_x, T* grad_velocity) {
  Transfer<T> t(settings, count, x);
  const auto v_new = t.load(v_out, 3);
  t.state.fill(T(0));  // from here on the planes hold gradients
  t.load(grad_x_out, 3, kPlaneX);
  t.load(grad_v_out, 3, kPlaneV);
  t.load(grad_C_out, 9, kPlaneC);
  t.for_chunks(
      [&](int c) { t.table.g2p_adjoint_records(t.planes(c), t.constants, &t.transfer[c]); });
  if (grad_velocity != nullptr) t.scatter_all(3, grad_velocity);
  if (grad_x == nullptr) return;
  t.take_grid(velocity, 3);
  t.for_chunks([&](int c) {
    alignas(64) T moments[kGatherAdjointPlanes * kChunk];
    t.table.gather_slopes(t.transfer[c], t.const_grid(), moments);
    t.table.g2p_adjoint_finish(t.transfer[c], moments, v_new.data() + c * 3 * kChunk, t.constants,
                               t.planes(c));
  });
  t.store(3, kPlaneX, grad_x);
}

namespace {

/// visit(layer, its nodes) for every layer of the grid, in parallel.
template <class T, class Visit>
void for_layers(int n, const Visit& visit) {
  const LayerBox whole{0, n, 0, n};
#pragma omp parallel for schedule(static)
  for (int i = 0; i < n; ++i) visit(i, whole);
}

/// A view whose layer i is `layer`.
template <class T>
GridView<T> one_layer(std::vector<T>& layer, int n) {
  return {layer.data(), std::ptrdiff_t(n) * 4, 0};
}

}  // namespace

template <class T>
void grid_update(const GridSettings& settings, const T* grid, T* velocity) {
  settings.check();
  const StepConstants<T> constants(settings);
  const MpmTable<T>& table = mpm_table<T>();
  const std::ptrdiff_t nodes = std::ptrdiff_t(settings.n) * settings.n;
  for_layers<T>(settings.n, [&](int i, const LayerBox& whole) {
    std::vector<T> layer(grid + i * nodes * 4, grid + (i + 1) * nodes * 4);
    table.grid_update(one_layer(layer, settings.n), i, whole, constants);
    for (std::ptrdiff_t k = 0; k < nodes; ++k) {
      std::copy_n(&layer[4 * k], 3, velocity + (i * nodes + k) * 3);
    }
  });
}

template <class T>
void grid_update_adjoint(const GridSettings& settings, const T* grid, const T* velocity,
                         const T* grad_velocity, T* grad_grid) {
  settings.check();
  const StepConstants<T> constants(settings);
  const MpmTable<T>& table = mpm_table<T>();
  const std::ptrdiff_t nodes = std::ptrdiff_t(settings.n) * settings.n;
  for_layers<T>(settings.n, [&](int i, const LayerBox& whole) {
    std::vector<T> layer(nodes * 4), grad(nodes * 4);
    for (std::ptrdiff_t k = 0; k < nodes; ++k) {
      std::copy_n(velocity + (i * nodes + k) * 3, 3, &layer[4 * k]);
      layer[4 * k + 3] = grid[(i * nodes + k) * 4 + 3];
      std::copy_n(grad_velocity + (i * nodes + k) * 3, 3, &grad[4 * k]);
    }
    const GridView<T> view = one_layer(layer, settings.n);
    table.grid_update_adjoint({view.data, view.row_stride, view.layer_stride},
                              one_layer(grad, settings.n), i, whole, constants);
    std::copy(grad.begin(), grad.end(), grad_grid + i * nodes * 4);
  });
}

#define UNIPHY_INSTANTIATE(T)                                                                     \
  template void p2g<T>(const GridSettings&, const ParticleArrays<T>&, T*);                        \
  template void p2g_adjoint<T>(const GridSettings&, const ParticleArrays<T>&, const T*,           \
                               const ParticleGradients<T>&);                                      \
  template void grid_update<T>(const GridSettings&, const T*, T*);                                \
  template void grid_update_adjoint<T>(const GridSettings&, const T*, const T*, const T*, T*);    \
  template void g2p<T>(const GridSettings&, std::ptrdiff_t, const T*, const T*, T*, T*, T*);      \
  template void g2p_adjoint<T>(const GridSettings&, std::ptrdiff_t, const T*, const T*, const T*, \
                               const T*, const T*, const T*, T*, T*);
UNIPHY_INSTANTIATE(float)
UNIPHY_INSTANTIATE(double)
#undef UNIPHY_INSTANTIATE

}  // namespace uniphy::kernels
