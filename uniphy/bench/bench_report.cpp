#include "uniphy/bench/bench_report.hpp"

#include <fmt/format.h>

#include <cmath>

#include "uniphy/io/atomic_file.hpp"

namespace uniphy::bench {
namespace {

/// "-" where the number is not there.
std::string cell(double value, const char* format, double factor = 1) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value * factor) : "-";
}

std::string time_cell(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  if (seconds < 1e-4) return fmt::format("{:.1f} ns", seconds * 1e9);
  return seconds < 0.1 ? fmt::format("{:.2f} ms", seconds * 1e3) : fmt::format("{:.2f} s", seconds);
}

}  // namespace

const BenchRow* BenchReport::find(const std::string& work, const std::string& pass,
                                  std::int64_t particles) const {
  for (const BenchRow& row : rows) {
    if (row.work == work && row.pass == pass && row.particles == particles) return &row;
  }
  return nullptr;
}

std::vector<const BenchRow*> BenchReport::all(const std::string& work,
                                              const std::string& pass) const {
  std::vector<const BenchRow*> found;
  for (const BenchRow& row : rows) {
    if (row.work == work && row.pass == pass) found.push_back(&row);
  }
  return found;
}

double speedup_of_both(const BenchRow& forward, const BenchRow& backward) {
  const auto ours = [](const BenchRow& r) { return r.plain_setting.threads == 1 ? r.one : r.all; };
  return (forward.plain + backward.plain) / (ours(forward) + ours(backward));
}

BenchRow make_row(const Measurer& measurer, const std::string& name, const std::string& work,
                  const std::string& pass, std::int64_t particles, double per_call) {
  BenchRow row;
  row.work = work;
  row.pass = pass;
  row.particles = particles;
  row.one = measurer.seconds(name, 1) / per_call;
  row.all = measurer.seconds(name, measurer.threads()) / per_call;
  if (measurer.has_baseline(name)) {
    const Measurer::Best best = measurer.baseline(name);
    row.plain = best.seconds / per_call;
    row.plain_setting = best.setting;
  }
  return row;
}

std::string rows_table(const BenchReport& report) {
  const Machine& m = report.machine;
  std::string text = fmt::format(
      "This machine: {}, multiply-adds {:.0f} Gflop/s a core ({:.0f} on {} threads), copy {:.1f} "
      "GB/s a core ({:.1f}), BLAS core type {}\n\n",
      m.isa, m.fma_core, m.fma_all, m.threads, m.copy_core, m.copy_all, m.blas);
  const char* layout = "{:<28} {:<9} {:>9} {:>11} {:>11} {:>7} {:>7} {:>11} {:>8}  {}\n";
  text += fmt::format(fmt::runtime(layout), "work", "pass", "particles", "1 thread",
                      fmt::format("{} threads", m.threads), "gain", "of FMA", "plain", "ratio",
                      "plain is fastest with");
  for (const BenchRow& r : report.rows) {
    text += fmt::format(fmt::runtime(layout), r.work, r.pass, r.particles, time_cell(r.one),
                        time_cell(r.all), cell(r.second_core(), "{:.2f}"),
                        cell(r.flops / r.one / 1e9 / m.fma_core, "{:.0f} %", 100),
                        time_cell(r.plain), cell(r.speedup(), "{:.1f}"),
                        std::isfinite(r.plain) ? describe(r.plain_setting) : "");
  }
  return text;
}

void write_rows(const BenchReport& report, const std::filesystem::path& csv) {
  std::string text =
      "work,pass,particles,one_thread_s,all_threads_s,plain_s,plain_threads,plain_blas_threads,"
      "flops,bytes,memory_mb\n";
  for (const BenchRow& r : report.rows) {
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", r.work, r.pass, r.particles, r.one,
                        r.all, r.plain, r.plain_setting.threads, r.plain_setting.blas_threads,
                        r.flops, r.bytes, r.memory_mb);
  }
  write_text_file(csv, text);
}

}  // namespace uniphy::bench
