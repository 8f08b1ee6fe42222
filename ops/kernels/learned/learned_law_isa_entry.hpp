#pragma once

// The learned law's table of the instruction set that the including translation unit is compiled
// for.

#include "ops/kernels/learned/isotropic_law_adjoint.hpp"
#include "ops/kernels/learned/published_law.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class T>
std::ptrdiff_t learned_scratch(const LearnedLaw<T>& law) {
  return law.form == LawForm::isotropic ? isotropic_scratch(law) : published_scratch(law);
}
template <class T>
void learned_evaluate(const LearnedLaw<T>& law, T flow_time, std::ptrdiff_t count,
                      View<const T> F_trial, View<const T> C, View<T> F_proj, View<T> tau,
                      T* scratch) {
  if (law.form == LawForm::isotropic)
    isotropic_evaluate(law, flow_time, count, F_trial, C, F_proj, tau, scratch);
  else
    published_evaluate(law, count, F_trial, C, F_proj, tau, scratch);
}
template <class T>
void learned_adjoint(const LearnedLaw<T>& law, T flow_time, std::ptrdiff_t count,
                     View<const T> F_trial, View<const T> C, View<const T> grad_F_proj,
                     View<const T> grad_tau, View<T> grad_F_trial, View<T> grad_C, T* accumulator,
                     T* weight_sums, T* scratch) {
  if (law.form == LawForm::isotropic)
    isotropic_adjoint(law, flow_time, count, F_trial, C, grad_F_proj, grad_tau, grad_F_trial,
                      grad_C, accumulator, weight_sums, scratch);
  else
    published_adjoint(law, count, F_trial, C, grad_F_proj, grad_tau, grad_F_trial, grad_C,
                      accumulator, weight_sums, scratch);
}
template <class T>
const T* table_mlp_forward(const PackedMlp<T>& net, const T* in, T* scratch) {
  return mlp_forward(net, in, scratch);
}
template <class T>
void table_mlp_tape(const PackedMlp<T>& net, const T* in, T* tape) {
  mlp_forward_tape(net, in, tape, true);
}
template <class T>
void table_mlp_backward(const PackedMlp<T>& net, const T* in, T* tape, const T* grad_out,
                        T* grad_in, T* first_bias, T* weight_sums) {
  mlp_backward(net, in, tape, grad_out, grad_in, first_bias, weight_sums);
}

template <class T>
const LearnedLawTable<T>& learned_law_isa_table() {
  static constexpr LearnedLawTable<T> kTable{learned_scratch<T>, learned_evaluate<T>,
                                             learned_adjoint<T>, table_mlp_forward<T>,
                                             table_mlp_tape<T>,  table_mlp_backward<T>};
  return kTable;
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
