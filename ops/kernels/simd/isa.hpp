#pragma once

#include <vector>

namespace uniphy::kernels {

/// The instruction sets that the inner loops are compiled for. `baseline` is what every CPU of the
/// architecture has (SSE2 on x86-64, NEON on arm64) and is there on all of them.
enum class Isa { baseline, avx2, avx512 };

const char* isa_name(Isa isa);

/// True where this build holds the code and this CPU can run it.
bool isa_available(Isa isa);

/// Every available set, worst first: what a test walks through.
std::vector<Isa> available_isas();

/// The set in use: the best available one, or the one that the environment variable UNIPHY_ISA
/// (baseline, sse2 as a synonym of it, avx2, avx512) asks for. Read once, at the first call.
/// Throws Error where the variable names an unknown set or one that is not available.
Isa active_isa();

}  // namespace uniphy::kernels
