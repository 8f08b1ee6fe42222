#include "ops/kernels/learned/learned_law_isa_entry.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
template <>
const LearnedLawTable<float>& isa_table() {
  return learned_law_isa_table<float>();
}
template <>
const LearnedLawTable<double>& isa_table() {
  return learned_law_isa_table<double>();
}
}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
