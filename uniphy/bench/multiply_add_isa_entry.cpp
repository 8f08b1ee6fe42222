// Compiled once for each instruction set, as the kernels are.

#include "ops/kernels/simd/lanes.hpp"
#include "uniphy/bench/bench_machine_isa.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace {

double multiply_adds(std::ptrdiff_t repeats, float* sink) {
  using V = Lanes<float>;
  // More chains than latency times units of any current CPU, and few enough for 16 registers.
  constexpr int kChains = 12;
  const V factor(0.999F), term(0.001F);
  V sum[kChains];
  for (int c = 0; c < kChains; ++c) sum[c] = V(static_cast<float>(c));
  for (std::ptrdiff_t r = 0; r < repeats; ++r) {
    for (int c = 0; c < kChains; ++c) sum[c] = lane_fma(sum[c], factor, term);
  }
  V total = sum[0];
  for (int c = 1; c < kChains; ++c) total = total + sum[c];
  *sink = lane_sum(total);
  return 2.0 * kChains * width_of<V> * static_cast<double>(repeats);
}

constexpr bench::MachineTable kTable{multiply_adds};

}  // namespace

template <>
const bench::MachineTable& isa_table() {
  return kTable;
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
