#pragma once

#include "ops/kernels/laws/law_table.hpp"
#include "ops/kernels/laws/material.hpp"
#include "ops/kernels/spectral/svd3.hpp"

// Loops over particles around the one-matrix-per-lane functions of a law: the entries of LawTable.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Absent views read as zero.
template <class V, class T>
UNIPHY_INLINE Mat3<V> load_optional(const View<const T>& view, std::ptrdiff_t p,
                                    std::ptrdiff_t count) {
  return view ? load_mat3<V, T>(view, p, count, false) : zero3<V>();
}
template <class V, class T>
UNIPHY_INLINE void store_optional(const View<T>& view, std::ptrdiff_t p, std::ptrdiff_t count,
                                  const Mat3<V>& value, bool accumulate = false) {
  if (view) store_mat3<V, T>(view, p, count, value, accumulate);
}

template <class Law, class T>
struct LawBatch {
  using V = Lanes<T>;
  using Memory = typename Law::template Memory<V>;
  static constexpr std::ptrdiff_t kWidth = width_of<V>;

  static void project(std::ptrdiff_t count, const LawParameters<T>& parameters, T dt,
                      View<const T> F, View<T> F_proj, const LawMemory<T>& memory) {
    const Material<V> m(parameters, dt);
    for (std::ptrdiff_t p = 0; p < count; p += kWidth) {
      const Mat3<V> f = load_mat3<V, T>(F, p, count - p, true);
      Memory lanes;
      lanes.load(memory, p, count - p);
      store_mat3<V, T>(F_proj, p, count - p, Law::project(f, m, lanes));
      lanes.store(memory, p, count - p);
    }
  }

  static void project_adjoint(std::ptrdiff_t count, const LawParameters<T>& parameters, T dt,
                              View<const T> F, View<const T> grad_F_proj, View<T> grad_F,
                              LawParameters<T>* grad, const LawMemoryAdjoint<T>& memory) {
    const Material<V> m(parameters, dt);
    MaterialGradient<V> g;
    for (std::ptrdiff_t p = 0; p < count; p += kWidth) {
      const Mat3<V> f = load_mat3<V, T>(F, p, count - p, true);
      const Mat3<V> gf = load_optional<V, T>(grad_F_proj, p, count - p);
      Memory lanes;
      lanes.load(memory, p, count - p);
      store_optional<V, T>(grad_F, p, count - p, Law::project_adjoint(f, m, gf, g, lanes));
      lanes.store(memory, p, count - p);
    }
    g.add_to(grad);
  }

  static void evaluate(std::ptrdiff_t count, const LawParameters<T>& parameters, T dt,
                       View<const T> F, View<const T> C, View<T> F_proj, View<T> tau,
                       const LawMemory<T>& memory) {
    const Material<V> m(parameters, dt);
    for (std::ptrdiff_t p = 0; p < count; p += kWidth) {
      const Mat3<V> f = load_mat3<V, T>(F, p, count - p, true);
      const Mat3<V> c = load_optional<V, T>(C, p, count - p);
      Mat3<V> projected, stress;
      Memory lanes;
      lanes.load(memory, p, count - p);
      Law::evaluate(f, c, m, projected, stress, lanes);
      lanes.store(memory, p, count - p);
      store_optional<V, T>(F_proj, p, count - p, projected);
      store_optional<V, T>(tau, p, count - p, stress);
    }
  }

  static void adjoint(std::ptrdiff_t count, const LawParameters<T>& parameters, T dt,
                      View<const T> F, View<const T> C, View<const T> grad_F_proj,
                      View<const T> grad_tau, View<T> grad_F, View<T> grad_C,
                      LawParameters<T>* grad, const LawMemoryAdjoint<T>& memory) {
    const Material<V> m(parameters, dt);
    MaterialGradient<V> g;
    for (std::ptrdiff_t p = 0; p < count; p += kWidth) {
      const Mat3<V> f = load_mat3<V, T>(F, p, count - p, true);
      const Mat3<V> c = load_optional<V, T>(C, p, count - p);
      Memory lanes;
      lanes.load(memory, p, count - p);
      const Mat3<V> gf = load_optional<V, T>(grad_F_proj, p, count - p);
      const Mat3<V> gt = load_optional<V, T>(grad_tau, p, count - p);
      Mat3<V> gc = zero3<V>();
      store_optional<V, T>(grad_F, p, count - p, Law::adjoint(f, c, m, gf, gt, gc, g, lanes));
      lanes.store(memory, p, count - p);
      store_optional<V, T>(grad_C, p, count - p, gc, true);
    }
    g.add_to(grad);
  }
};

template <class Stress, class T>
struct StressBatch {
  using V = Lanes<T>;
  static constexpr std::ptrdiff_t kWidth = width_of<V>;

  static void stress(std::ptrdiff_t count, const LawParameters<T>& parameters, View<const T> F,
                     View<const T> C, View<T> tau) {
    const Material<V> m(parameters, T(0));
    for (std::ptrdiff_t p = 0; p < count; p += kWidth) {
      const Mat3<V> f = load_mat3<V, T>(F, p, count - p, true);
      const Mat3<V> c = load_optional<V, T>(C, p, count - p);
      store_mat3<V, T>(tau, p, count - p, Stress::stress(f, c, m));
    }
  }

  static void stress_adjoint(std::ptrdiff_t count, const LawParameters<T>& parameters,
                             View<const T> F, View<const T> C, View<const T> grad_tau,
                             View<T> grad_F, View<T> grad_C, LawParameters<T>* grad) {
    const Material<V> m(parameters, T(0));
    MaterialGradient<V> g;
    for (std::ptrdiff_t p = 0; p < count; p += kWidth) {
      const Mat3<V> f = load_mat3<V, T>(F, p, count - p, true);
      const Mat3<V> c = load_optional<V, T>(C, p, count - p);
      const Mat3<V> gt = load_optional<V, T>(grad_tau, p, count - p);
      Mat3<V> gc = zero3<V>();
      store_optional<V, T>(grad_F, p, count - p, Stress::stress_adjoint(f, c, m, gt, gc, g));
      store_optional<V, T>(grad_C, p, count - p, gc, true);
    }
    g.add_to(grad);
  }
};

/// The entries of a law. Its stress is one of few, so that laws with the same one share its code.
template <class Law, class T>
constexpr typename LawTable<T>::Law law_entries() {
  using Batch = LawBatch<Law, T>;
  using Stress = StressBatch<typename Law::Stress, T>;
  return {Batch::project,         Batch::project_adjoint, Stress::stress,
          Stress::stress_adjoint, Batch::evaluate,        Batch::adjoint};
}

template <class T>
void svd3_batch(std::ptrdiff_t count, View<const T> F, View<T> U, View<T> sigma, View<T> Vh) {
  using V = Lanes<T>;
  constexpr std::ptrdiff_t w = width_of<V>;
  for (std::ptrdiff_t pair = 0; pair < count; pair += 2 * w) {
    const std::ptrdiff_t at[2] = {pair, pair + w};
    Svd3<V> s[2];
    svd3({load_mat3<V, T>(F, at[0], count - at[0], true),
          load_mat3<V, T>(F, at[1], count - at[1], true)},
         s);
    for (int k = 0; k < 2; ++k) {
      const std::ptrdiff_t p = at[k], left = count - p;
      store_mat3<V, T>(U, p, left, s[k].U);
      for (int i = 0; i < 3; ++i) store_lanes<V, T>(sigma, p, i, left, s[k].sigma[i]);
      store_mat3<V, T>(Vh, p, left, transpose(s[k].V_));
    }
  }
}

template <class T>
void svd3_adjoint_batch(std::ptrdiff_t count, View<const T> U, View<const T> sigma,
                        View<const T> Vh, View<const T> grad_U, View<const T> grad_sigma,
                        View<const T> grad_Vh, View<T> grad_F) {
  using V = Lanes<T>;
  for (std::ptrdiff_t p = 0; p < count; p += width_of<V>) {
    const std::ptrdiff_t left = count - p;
    Svd3<V> s;
    s.U = load_mat3<V, T>(U, p, left, true);
    s.V_ = transpose(load_mat3<V, T>(Vh, p, left, true));
    Vec3<V> gs;
    for (int k = 0; k < 3; ++k) {
      s.sigma[k] = load_lanes<V, T>(sigma, p, k, left, T(1));
      gs[k] = grad_sigma ? load_lanes<V, T>(grad_sigma, p, k, left, T(0)) : V(T(0));
    }
    const Mat3<V> gu = load_optional<V, T>(grad_U, p, left);
    const Mat3<V> gv = transpose(load_optional<V, T>(grad_Vh, p, left));
    store_mat3<V, T>(grad_F, p, left, svd3_adjoint(s, gu, gs, gv));
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
