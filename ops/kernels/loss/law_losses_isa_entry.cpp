// The table of law_losses_table.hpp of the instruction set that this file is compiled for.

#include "ops/kernels/loss/law_losses_adjoint.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace {

template <class T>
constexpr LawLossesTable<T> kTable{law_losses<T>, law_losses_adjoint<T>, isotropic_features<T>,
                                   isotropic_features_adjoint<T>};

}  // namespace

UNIPHY_DEFINE_ISA_TABLES(LawLossesTable, kTable)

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
