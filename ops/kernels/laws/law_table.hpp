#pragma once

#include <cstddef>

#include "ops/kernels/laws/law_memory.hpp"
#include "ops/kernels/simd/dispatch.hpp"
#include "ops/kernels/simd/view.hpp"

namespace uniphy::kernels {

/// The parameters of an analytic law and, at the same places, the gradient with respect to them.
/// Units: law_parameters.hpp.
template <class T>
struct LawParameters {
  T mu = 0, lambda = 0, tau_y = 0, theta = 0, eta = 0;
  T c1 = 0, c2 = 0, eta_inf = 0, kappa = 0, n = 0, cohesion = 0;
};
inline constexpr int kLawParameters = 11;
/// The first of them are all that the five families have.
inline constexpr int kFamilyParameters = 5;
/// Its members, for loops over the places.
template <class T>
inline constexpr T LawParameters<T>::*kLawParameterMembers[kLawParameters] = {
    &LawParameters<T>::mu,    &LawParameters<T>::lambda,  &LawParameters<T>::tau_y,
    &LawParameters<T>::theta, &LawParameters<T>::eta,     &LawParameters<T>::c1,
    &LawParameters<T>::c2,    &LawParameters<T>::eta_inf, &LawParameters<T>::kappa,
    &LawParameters<T>::n,     &LawParameters<T>::cohesion};

/// The number of analytic laws: LawId before `learned`.
inline constexpr int kAnalyticLaws = 12;

/// Entry points of the code compiled for one instruction set. Plain function pointers over views,
/// one thread, any count; absent views (null data) read as zero and are not written. Memory is that
/// of laws that have one (law_has_memory), ignored by the others. Matrices are nine numbers,
/// row-major. In and out may be the same memory where the layout agrees.
template <class T>
struct LawTable {
  using In = View<const T>;
  using Out = View<T>;
  using Parameters = LawParameters<T>;

  struct Law {
    /// F → F_proj
    void (*project)(std::ptrdiff_t count, const Parameters&, T dt, In F, Out F_proj,
                    const LawMemory<T>&);
    /// dL/dF_proj → dL/dF (overwritten); parameters accumulate into *grad unless it is null.
    void (*project_adjoint)(std::ptrdiff_t count, const Parameters&, T dt, In F, In grad_F_proj,
                            Out grad_F, Parameters* grad, const LawMemoryAdjoint<T>&);
    /// F, C → tau
    void (*stress)(std::ptrdiff_t count, const Parameters&, In F, In C, Out tau);
    /// dL/dtau → dL/dF (overwritten), dL/dC (added).
    void (*stress_adjoint)(std::ptrdiff_t count, const Parameters&, In F, In C, In grad_tau,
                           Out grad_F, Out grad_C, Parameters* grad);
    /// Both in one pass over the particles, with at most one SVD each.
    void (*evaluate)(std::ptrdiff_t count, const Parameters&, T dt, In F, In C, Out F_proj, Out tau,
                     const LawMemory<T>&);
    void (*adjoint)(std::ptrdiff_t count, const Parameters&, T dt, In F, In C, In grad_F_proj,
                    In grad_tau, Out grad_F, Out grad_C, Parameters* grad,
                    const LawMemoryAdjoint<T>&);
  };

  /// F → U, sigma (three numbers), Vᵀ
  void (*svd3)(std::ptrdiff_t count, In F, Out U, Out sigma, Out Vh);
  void (*svd3_adjoint)(std::ptrdiff_t count, In U, In sigma, In Vh, In grad_U, In grad_sigma,
                       In grad_Vh, Out grad_F);
  Law laws[kAnalyticLaws];  ///< indexed by LawId
};

UNIPHY_ISA_TABLE(LawTable<float>)
UNIPHY_ISA_TABLE(LawTable<double>)

/// The table of an instruction set, the active one by default. Throws Error where it is not
/// available.
template <class T>
const LawTable<T>& law_table(Isa isa = active_isa()) {
  return table_of<LawTable<T>>(isa);
}

}  // namespace uniphy::kernels
