#pragma once

#include <algorithm>

#include "ops/kernels/laws/law.hpp"

namespace uniphy::bench {

/// G(F) = F, τ = k (F − I): next to no arithmetic, so that a roll-out with it costs what the step
/// around the law costs.
template <class T>
class FreeLaw : public kernels::LawKernel<T> {
 public:
  static constexpr T kStiffness = T(1e3);  // Pa

  std::ptrdiff_t parameter_size() const override { return 0; }
  std::ptrdiff_t accumulator_size() const override { return 0; }
  void parameter_gradient(const T*, T*) const override {}

  void evaluate(std::ptrdiff_t count, T, kernels::View<const T> F_trial, kernels::View<const T>,
                kernels::View<T> F_proj, kernels::View<T> tau,
                const kernels::LawMemory<T>&) const override {
    for (int k = 0; k < 9; ++k) {
      const T one = k % 4 == 0 ? T(1) : T(0);
      for (std::ptrdiff_t p = 0; p < count; ++p) {
        const T F = F_trial(p, k);
        F_proj(p, k) = F;
        tau(p, k) = kStiffness * (F - one);
      }
    }
  }

  void adjoint(std::ptrdiff_t count, T, kernels::View<const T>, kernels::View<const T>,
               kernels::View<const T> grad_F_proj, kernels::View<const T> grad_tau,
               kernels::View<T> grad_F_trial, kernels::View<T>, T*, T*,
               const kernels::LawMemoryAdjoint<T>&) const override {
    for (int k = 0; k < 9; ++k) {
      for (std::ptrdiff_t p = 0; p < count; ++p) {
        grad_F_trial(p, k) = grad_F_proj(p, k) + kStiffness * grad_tau(p, k);
      }
    }
  }
};

}  // namespace uniphy::bench
