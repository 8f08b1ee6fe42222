// The table of law_losses_table.hpp of the instruction set that this file is compiled for.

#include "ops/kernels/loss/law_losses_adjoint.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class T>
const LawLossesTable<T>& law_losses_isa_table() {
  static constexpr LawLossesTable<T> kTable{law_losses<T>, law_losses_adjoint<T>,
                                            isotropic_features<T>, isotropic_features_adjoint<T>};
  return kTable;
}
template const LawLossesTable<float>& law_losses_isa_table<float>();
template const LawLossesTable<double>& law_losses_isa_table<double>();

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
