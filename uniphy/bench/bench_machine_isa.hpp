#pragma once

#include <cstddef>

#include "ops/kernels/simd/dispatch.hpp"

namespace uniphy::bench {

/// What is measured of the CPU itself, compiled for one instruction set.
struct MachineTable {
  /// `repeats` rounds of independent float32 multiply-adds that never leave the registers. Returns
  /// the flops done, 2 a multiply-add; *sink takes a result, so that the work has a purpose.
  double (*multiply_adds)(std::ptrdiff_t repeats, float* sink);
};

}  // namespace uniphy::bench

namespace uniphy::kernels {
UNIPHY_ISA_TABLE(bench::MachineTable)
}  // namespace uniphy::kernels
