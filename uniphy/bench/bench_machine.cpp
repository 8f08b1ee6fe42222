#include <omp.h>

#include <cstring>
#include <vector>

#include "uniphy/bench/bench_machine_isa.hpp"
#include "uniphy/bench/subjects.hpp"

namespace uniphy::bench {

void bench_machine(const BenchOptions& options, int threads, BenchReport& report) {
  // What the CPU has, even where UNIPHY_ISA asks the kernels to use less.
  const kernels::Isa isa = kernels::available_isas().back();
  const auto& machine = kernels::table_of<MachineTable>(isa);
  constexpr std::ptrdiff_t kRepeats = 1 << 18;
  double flops = 0;  // of one thread, the same in each call
  Measurer measurer(threads);
  measurer.add("fma", [&] {
#pragma omp parallel
    {
      float sink = 0;
      const double done = machine.multiply_adds(kRepeats, &sink);
      if (omp_get_thread_num() == 0) flops = done + (sink > 1e30F ? 1 : 0);
    }
  });
  std::vector<char> from(static_cast<std::size_t>(options.copy_mb) << 20, 1), to(from.size(), 2);
  measurer.add("copy", [&] {
#pragma omp parallel
    {
      const std::size_t part = omp_get_thread_num(), parts = omp_get_num_threads();
      const std::size_t begin = from.size() * part / parts, end = from.size() * (part + 1) / parts;
      std::memcpy(to.data() + begin, from.data() + begin, end - begin);
    }
  });
  // The reference of all shares of the peak: as careful as it may be.
  measurer.run({options.effort.rounds * 2, options.effort.seconds, 2 * options.effort.budget});

  Machine& m = report.machine;
  m.isa = kernels::isa_name(isa);
  m.blas = blas_core_type();
  m.threads = threads;
  m.fma_core = flops / measurer.seconds("fma", 1) / 1e9;
  m.fma_all = threads * flops / measurer.seconds("fma", threads) / 1e9;
  const double bytes = 2.0 * static_cast<double>(from.size());
  m.copy_core = bytes / measurer.seconds("copy", 1) / 1e9;
  m.copy_all = bytes / measurer.seconds("copy", threads) / 1e9;
}

}  // namespace uniphy::bench
