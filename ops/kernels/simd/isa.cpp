#include "ops/kernels/simd/isa.hpp"

#include <cstdlib>
#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {
namespace {

Isa choose() {
  const char* wish = std::getenv("UNIPHY_ISA");
  if (wish == nullptr || *wish == '\0') return available_isas().back();
  const std::string name = wish;
  for (const Isa isa : {Isa::baseline, Isa::avx2, Isa::avx512}) {
    if (name != isa_name(isa) && !(name == "sse2" && isa == Isa::baseline)) continue;
    if (isa_available(isa)) return isa;
    throw Error("environment variable UNIPHY_ISA: " + name +
                " is not available on this CPU or in this build; the best here is " +
                isa_name(available_isas().back()));
  }
  throw Error("environment variable UNIPHY_ISA: expected baseline, avx2 or avx512, found \"" +
              name + "\"");
}

}  // namespace

const char* isa_name(Isa isa) {
  switch (isa) {
    case Isa::avx512:
      return "avx512";
    case Isa::avx2:
      return "avx2";
    case Isa::baseline:
      break;
  }
  return "baseline";
}

bool isa_available(Isa isa) {
#if defined(UNIPHY_HAVE_X86_ISA)
  switch (isa) {
    case Isa::avx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
             __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512cd") &&
             __builtin_cpu_supports("avx512vl") && isa_available(Isa::avx2);
    case Isa::avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case Isa::baseline:
      break;
  }
  return true;
#else
  return isa == Isa::baseline;
#endif
}

std::vector<Isa> available_isas() {
  std::vector<Isa> all;
  for (const Isa isa : {Isa::baseline, Isa::avx2, Isa::avx512}) {
    if (isa_available(isa)) all.push_back(isa);
  }
  return all;
}

Isa active_isa() {
  static const Isa isa = choose();
  return isa;
}

}  // namespace uniphy::kernels
