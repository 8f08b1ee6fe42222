// The table of isotropic_errors_table.hpp of the instruction set that this file is compiled for.

#include "ops/kernels/isotropic_errors_adjoint.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

template <class T>
const IsotropicErrorsTable<T>& isotropic_errors_isa_table() {
  static constexpr IsotropicErrorsTable<T> kTable{isotropic_errors<T>, isotropic_errors_adjoint<T>,
                                                  isotropic_features<T>,
                                                  isotropic_features_adjoint<T>};
  return kTable;
}
template const IsotropicErrorsTable<float>& isotropic_errors_isa_table<float>();
template const IsotropicErrorsTable<double>& isotropic_errors_isa_table<double>();

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
