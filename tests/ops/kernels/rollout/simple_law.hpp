#pragma once

#include <cmath>
#include <vector>

#include "ops/kernels/laws/law.hpp"

namespace uniphy::kernels {

/// τ = μ F Fᵀ + (λ log J − μ) I + ζ (C + Cᵀ)/2 with G(F) = (1 − β) F + β I, in plain scalar code: a
/// law for tests of the step itself. ζ and β make every path of the adjoint matter.
template <class T>
class SimpleLaw : public LawKernel<T> {
 public:
  SimpleLaw(double mu, double lambda, double zeta = 0, double beta = 0)
      : mu_(T(mu)), lambda_(T(lambda)), zeta_(T(zeta)), beta_(T(beta)) {}

  std::ptrdiff_t parameter_size() const override { return 4; }
  std::ptrdiff_t accumulator_size() const override { return 4; }
  void parameter_gradient(const T* accumulator, T* gradient) const override {
    for (int k = 0; k < 4; ++k) gradient[k] = accumulator[k];
  }

  void evaluate(std::ptrdiff_t count, T, View<const T> F_trial, View<const T> C, View<T> F_proj,
                View<T> tau, const LawMemory<T>& = {}) const override {
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      T F[9];
      project(F_trial, p, F);
      const T pressure = lambda_ * std::log(determinant(F)) - mu_;
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
          T FFt = 0;
          for (int k = 0; k < 3; ++k) FFt += F[3 * a + k] * F[3 * b + k];
          tau(p, 3 * a + b) = mu_ * FFt + (a == b ? pressure : T(0)) +
                              zeta_ / 2 * (C(p, 3 * a + b) + C(p, 3 * b + a));
        }
      }
      for (int k = 0; k < 9; ++k) F_proj(p, k) = F[k];
    }
  }

  void adjoint(std::ptrdiff_t count, T, View<const T> F_trial, View<const T> C,
               View<const T> grad_F_proj, View<const T> grad_tau, View<T> grad_F_trial,
               View<T> grad_C, T* accumulator, T* = nullptr,
               const LawMemoryAdjoint<T>& = {}) const override {
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      T F[9], g[9], cofactor[9], sum[4] = {0, 0, 0, 0};
      project(F_trial, p, F);
      const T J = determinant(F);
      cofactors(F, cofactor);
      T trace = 0;
      for (int a = 0; a < 3; ++a) trace += grad_tau(p, 4 * a);
      sum[0] -= trace;
      sum[1] += trace * std::log(J);
      for (int a = 0; a < 3; ++a) {
        for (int k = 0; k < 3; ++k) {
          T both = 0;
          for (int b = 0; b < 3; ++b) {
            both += (grad_tau(p, 3 * a + b) + grad_tau(p, 3 * b + a)) * F[3 * b + k];
            sum[0] += grad_tau(p, 3 * a + b) * F[3 * a + k] * F[3 * b + k];
          }
          const int i = 3 * a + k;
          const T symmetric = (grad_tau(p, i) + grad_tau(p, 3 * k + a)) / 2;
          sum[2] += symmetric * C(p, i);
          if (grad_C) grad_C(p, i) += zeta_ * symmetric;
          g[i] = (grad_F_proj ? grad_F_proj(p, i) : T(0)) + mu_ * both +
                 lambda_ * trace / J * cofactor[i];
          sum[3] += g[i] * ((a == k ? T(1) : T(0)) - F_trial(p, i));
        }
      }
      for (int k = 0; k < 9; ++k) grad_F_trial(p, k) = (1 - beta_) * g[k];
      if (accumulator != nullptr) {
        for (int k = 0; k < 4; ++k) accumulator[k] += sum[k];
      }
    }
  }

 private:
  void project(View<const T> F_trial, std::ptrdiff_t p, T* F) const {
    for (int k = 0; k < 9; ++k) {
      F[k] = (1 - beta_) * F_trial(p, k) + (k % 4 == 0 ? beta_ : T(0));
    }
  }
  static void cofactors(const T* F, T* c) {
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const int a1 = (a + 1) % 3, a2 = (a + 2) % 3, b1 = (b + 1) % 3, b2 = (b + 2) % 3;
        c[3 * a + b] = F[3 * a1 + b1] * F[3 * a2 + b2] - F[3 * a1 + b2] * F[3 * a2 + b1];
      }
    }
  }
  static T determinant(const T* F) {
    T c[9];
    cofactors(F, c);
    return F[0] * c[0] + F[1] * c[1] + F[2] * c[2];
  }

  T mu_, lambda_, zeta_, beta_;
};

/// The same with a smooth memory: m' = 0.95 m + 0.05 tr F_trial, and χ m' 1 is added to the stress.
template <class T>
class SimpleMemoryLaw final : public LawKernel<T> {
 public:
  SimpleMemoryLaw(const SimpleLaw<T>& law, T chi) : law_(law), chi_(chi) {}

  std::ptrdiff_t parameter_size() const override { return 4; }
  std::ptrdiff_t accumulator_size() const override { return 4; }
  void parameter_gradient(const T* accumulator, T* gradient) const override {
    law_.parameter_gradient(accumulator, gradient);
  }
  bool has_memory() const override { return true; }

  void evaluate(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C, View<T> F_proj,
                View<T> tau, const LawMemory<T>& memory) const override {
    std::vector<T> after(count);
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      after[p] =
          T(0.95) * memory.before(p, 0) + T(0.05) * (F_trial(p, 0) + F_trial(p, 4) + F_trial(p, 8));
    }
    law_.evaluate(count, dt, F_trial, C, F_proj, tau);
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      memory.after(p, 0) = after[p];
      for (int a = 0; a < 3; ++a) tau(p, 4 * a) += chi_ * after[p];
    }
  }

  void adjoint(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C,
               View<const T> grad_F_proj, View<const T> grad_tau, View<T> grad_F_trial,
               View<T> grad_C, T* accumulator, T*,
               const LawMemoryAdjoint<T>& memory) const override {
    std::vector<T> g(count);
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      g[p] = memory.grad_after(p, 0);
      for (int a = 0; a < 3; ++a) g[p] += chi_ * grad_tau(p, 4 * a);
    }
    law_.adjoint(count, dt, F_trial, C, grad_F_proj, grad_tau, grad_F_trial, grad_C, accumulator);
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      memory.grad_before(p, 0) = T(0.95) * g[p];
      for (int a = 0; a < 3; ++a) grad_F_trial(p, 4 * a) += T(0.05) * g[p];
    }
  }

 private:
  SimpleLaw<T> law_;
  T chi_;
};

}  // namespace uniphy::kernels
