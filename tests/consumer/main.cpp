#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/simd/isa.hpp"

int main() {
  try {
    std::printf("uniphy kernels run on %s\n",
                uniphy::kernels::isa_name(uniphy::kernels::active_isa()));
  } catch (const uniphy::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
