#pragma once

#include <cstddef>

#include "ops/kernels/simd/isa.hpp"

namespace uniphy::bench {

/// `repeats` rounds of independent float32 multiply-adds that never leave the registers, with the
/// vectors of the instruction set. Returns the flops done, 2 a multiply-add; *sink takes a result,
/// so that the work has a purpose.
double multiply_adds(kernels::Isa isa, std::ptrdiff_t repeats, float* sink);

}  // namespace uniphy::bench
