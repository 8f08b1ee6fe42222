#include "uniphy/bench/bench.hpp"

#include <malloc.h>
#include <unistd.h>

#include <cstdlib>

int main(int argc, char** argv) {
  // OpenBLAS reads this before main: a core type older than the CPU would slow the plain-tensor
  // versions. The process starts again without it.
  if (std::getenv("OPENBLAS_CORETYPE") != nullptr) {
    ::unsetenv("OPENBLAS_CORETYPE");
    ::execv("/proc/self/exe", argv);  // returns only where that is not possible
  }
  // Freed tensors stay with the process. Else most of what some calls take, ours and the
  // plain-tensor versions' alike, is the kernel clearing pages.
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
  return uniphy::run_experiment(argc, argv, uniphy::bench::bench_info(),
                                uniphy::bench::declare_bench);
}
