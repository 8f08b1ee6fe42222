// Compiled once for each instruction set. Nothing here may be a symbol that another translation
// unit can define as well: all code sits in the inline namespace of the instruction set.

#include "ops/kernels/mpm/deformation_update.hpp"
#include "ops/kernels/mpm/g2p.hpp"
#include "ops/kernels/mpm/g2p_adjoint.hpp"
#include "ops/kernels/mpm/grid_update_adjoint.hpp"
#include "ops/kernels/mpm/mpm_table.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace {

template <class T>
constexpr MpmTable<T> kTable{stencil<T>,
                             deformation_update<T>,
                             deformation_update_adjoint<T>,
                             p2g_records<T>,
                             scatter<T>,
                             grid_update<T>,
                             grid_update_adjoint<T>,
                             gather<T>,
                             g2p_finish<T>,
                             g2p_adjoint_records<T>,
                             gather_adjoint<true, T>,
                             g2p_adjoint_finish<T>,
                             gather_adjoint<false, T>,
                             p2g_adjoint_finish<T>};

}  // namespace

UNIPHY_DEFINE_ISA_TABLES(MpmTable, kTable)

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
