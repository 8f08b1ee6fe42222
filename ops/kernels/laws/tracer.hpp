#pragma once

#include "ops/kernels/laws/law.hpp"

namespace uniphy::kernels {

/// What stands in the place of a law for tracers: particles without mass or volume, which give
/// nothing to the grid and move with its velocity, x ← x + Δt Σ w v_node. No stress; the trial
/// deformation gradient is kept, so that F, begun at I, is the flow gradient dx/dx₀ of the motion
/// as C tells it. F itself is not differentiated.
template <class T>
class Tracer : public LawKernel<T> {
 public:
  std::ptrdiff_t parameter_size() const override { return 0; }
  std::ptrdiff_t accumulator_size() const override { return 0; }
  void parameter_gradient(const T*, T*) const override {}

  void evaluate(std::ptrdiff_t count, T, View<const T> F_trial, View<const T>, View<T> F_proj,
                View<T> tau, const LawMemory<T>&) const override {
    for (std::ptrdiff_t k = 0; k < 9; ++k) {
      for (std::ptrdiff_t p = 0; p < count; ++p) {
        F_proj(p, k) = F_trial(p, k);
        tau(p, k) = 0;
      }
    }
  }

  void adjoint(std::ptrdiff_t count, T, View<const T>, View<const T>, View<const T>, View<const T>,
               View<T> grad_F_trial, View<T>, T*, T*, const LawMemoryAdjoint<T>&) const override {
    for (std::ptrdiff_t k = 0; k < 9; ++k) {
      for (std::ptrdiff_t p = 0; p < count; ++p) grad_F_trial(p, k) = 0;
    }
  }
};

/// Whether a body consists of tracers.
template <class T>
bool is_tracer(const LawKernel<T>& law) {
  return dynamic_cast<const Tracer<T>*>(&law) != nullptr;
}

}  // namespace uniphy::kernels
