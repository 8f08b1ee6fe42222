#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "uniphy/bench/measurer.hpp"

namespace uniphy::bench {

inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// What this machine can do.
struct Machine {
  std::string isa;       ///< the widest instruction set
  std::string blas;      ///< the core type of OpenBLAS
  int threads = 1;       ///< what "all" means below
  double fma_core = 0;   ///< float32 multiply-adds of one core, Gflop/s (2 flop each)
  double fma_all = 0;    ///< of all threads
  double copy_core = 0;  ///< bytes read and written by a large copy on one core, GB/s
  double copy_all = 0;   ///< by all threads
};

/// One measured thing. Times are for one particle (matrix, particle-step, sample) or, in an epoch,
/// for the whole.
struct BenchRow {
  std::string work;            ///< "svd3 f32", "law sand", "learned published", "mpm step", …
  std::string pass;            ///< "forward", "backward", "both"
  std::int64_t particles = 0;  ///< of one call
  double one = kNone;          ///< s on one thread
  double all = kNone;          ///< s on all threads
  double plain = kNone;        ///< s of the plain-tensor version at its best setting
  ThreadSetting plain_setting;
  double flops = kNone;      ///< counted for one particle, 2 a multiply-add
  double bytes = kNone;      ///< that must be read and written for one particle
  double memory_mb = kNone;  ///< peak memory that the work added, MiB

  /// On the number of threads at which the plain version is fastest.
  double speedup() const { return plain / (plain_setting.threads == 1 ? one : all); }
  double second_core() const { return one / all; }
};

struct BenchReport {
  Machine machine;
  std::vector<BenchRow> rows;

  /// The row, or null where it was not measured.
  const BenchRow* find(const std::string& work, const std::string& pass,
                       std::int64_t particles) const;
  std::vector<const BenchRow*> all(const std::string& work, const std::string& pass) const;
};

/// Ratio of plain to our time for the value and the gradient together, measured apart.
double speedup_of_both(const BenchRow& forward, const BenchRow& backward);

/// The row of work `name` of the measurer, whose calls handle `per_call` particles each.
BenchRow make_row(const Measurer& measurer, const std::string& name, const std::string& work,
                  const std::string& pass, std::int64_t particles, double per_call);

/// All rows as text.
std::string rows_table(const BenchReport& report);
void write_rows(const BenchReport& report, const std::filesystem::path& csv);

}  // namespace uniphy::bench
