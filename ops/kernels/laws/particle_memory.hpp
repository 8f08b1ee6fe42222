#pragma once

#include "ops/kernels/laws/law_memory.hpp"
#include "ops/kernels/laws/return_map.hpp"

// What a law remembers of a particle from step to step, one number per lane.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Of a law whose state is F alone.
template <class V>
struct NoMemory {
  static constexpr bool kKept = false;
  using T = ScalarOf<V>;

  UNIPHY_INLINE void load(const LawMemory<T>&, std::ptrdiff_t, std::ptrdiff_t) {}
  UNIPHY_INLINE void store(const LawMemory<T>&, std::ptrdiff_t, std::ptrdiff_t) const {}
  UNIPHY_INLINE void load(const LawMemoryAdjoint<T>&, std::ptrdiff_t, std::ptrdiff_t) {}
  UNIPHY_INLINE void store(const LawMemoryAdjoint<T>&, std::ptrdiff_t, std::ptrdiff_t) const {}

  UNIPHY_INLINE void shift(HenckyStrain<V>&) {}
  UNIPHY_INLINE MaskOf<V> moves(const MaskOf<V>& yields) const { return yields; }
  UNIPHY_INLINE void adjoint(const HenckyStrain<V>&, const ReturnMap<V>&, const V&,
                             StrainGradient<V>&) {}
};

/// The volume correction of granular matter. Grains that part lose the volume that their F
/// measured; v_c, the logarithm of it, is kept, and has to be given back before they press on each
/// other again: the mapping sees ε + v_c/3 in place of ε, and v_c += tr ε − tr ε', ε' the projected
/// strain. Without it sand grows with every separation. A mapping that goes to U Vᵀ where the trace
/// is positive and keeps it elsewhere, as Drucker–Prager does, leaves v_c = max(0, tr ε + v_c).
/// A. P. Tampubolon et al., Multi-species simulation of porous sand and water mixtures, ACM TOG
/// 36(4), 2017, section 4.3.4.
template <class V>
struct VolumeMemory {
  static constexpr bool kKept = true;
  using T = ScalarOf<V>;
  V before = V(T(0)), after = V(T(0));
  V grad = V(T(0));  ///< dL/d(after), then dL/d(before)

  UNIPHY_INLINE void load(const LawMemory<T>& memory, std::ptrdiff_t p, std::ptrdiff_t left) {
    before = optional(memory.before, p, left);
  }
  UNIPHY_INLINE void store(const LawMemory<T>& memory, std::ptrdiff_t p,
                           std::ptrdiff_t left) const {
    if (memory.after) store_lanes<V, T>(memory.after, p, 0, left, after);
  }
  UNIPHY_INLINE void load(const LawMemoryAdjoint<T>& memory, std::ptrdiff_t p,
                          std::ptrdiff_t left) {
    before = optional(memory.before, p, left);
    grad = optional(memory.grad_after, p, left);
  }
  UNIPHY_INLINE void store(const LawMemoryAdjoint<T>& memory, std::ptrdiff_t p,
                           std::ptrdiff_t left) const {
    if (memory.grad_before) store_lanes<V, T>(memory.grad_before, p, 0, left, grad);
  }

  /// The strain as the mapping sees it.
  UNIPHY_INLINE void shift(HenckyStrain<V>& h) {
    h.trace = h.trace + before;
    after = lane_max(V(T(0)), h.trace);
  }
  /// Where F changes.
  UNIPHY_INLINE MaskOf<V> moves(const MaskOf<V>& yields) const {
    return yields || before > V(T(0)) || before < V(T(0));
  }
  /// Adds what comes through v_c to dL/d(tr ε), which then is dL/dv_c too. The mapping has added
  /// the part of the lanes that yield.
  UNIPHY_INLINE void adjoint(const HenckyStrain<V>& h, const ReturnMap<V>& r, const V& grad_trace,
                             StrainGradient<V>& strain) {
    const V zero(T(0));
    strain.trace = strain.trace + select<V>(r.yields, zero, grad_trace) +
                   select<V>(h.trace > zero, grad, zero);
    grad = strain.trace;
  }

 private:
  static UNIPHY_INLINE V optional(const View<const T>& view, std::ptrdiff_t p,
                                  std::ptrdiff_t left) {
    return view ? load_lanes<V, T>(view, p, 0, left, T(0)) : V(T(0));
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
