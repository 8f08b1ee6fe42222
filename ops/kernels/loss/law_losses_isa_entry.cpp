// The table of law_losses_table.hpp of the instruction set that this file is compiled for.

#include "ops/kernels/loss/law_losses_adjoint.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace {

template <class T>
constexpr LawLossesTable<T> kTable{law_losses<T>, law_losses_adjoint<T>, isotropic_features<T>,
                                   isotropic_features_adjoint<T>};

}  // namespace

template <>
const LawLossesTable<float>& isa_table() {
  return kTable<float>;
}
template <>
const LawLossesTable<double>& isa_table() {
  return kTable<double>;
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
