#include "uniphy/bench/bench.hpp"

#include <unistd.h>

#include <cstdlib>

int main(int argc, char** argv) {
  // OpenBLAS reads this before main: a core type older than the CPU would slow the plain-tensor
  // versions. The process starts again without it.
  if (std::getenv("OPENBLAS_CORETYPE") != nullptr) {
    ::unsetenv("OPENBLAS_CORETYPE");
    ::execv("/proc/self/exe", argv);  // returns only where that is not possible
  }
  return uniphy::run_experiment(argc, argv, uniphy::bench::bench_info(),
                                uniphy::bench::declare_bench);
}
