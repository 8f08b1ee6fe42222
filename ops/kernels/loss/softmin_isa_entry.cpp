// The table of softmin_table.hpp of the instruction set that this file is compiled for.

#include "ops/kernels/loss/softmin.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace {

constexpr SoftminTable kTable{softmin, softmin_adjoint, barycentres, barycentres_adjoint};

}  // namespace

template <>
const SoftminTable& isa_table() {
  return kTable;
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
