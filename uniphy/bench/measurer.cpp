#include "uniphy/bench/measurer.hpp"

#include <benchmark/benchmark.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <thread>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/interrupt.hpp"

namespace uniphy::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kThreadsMustGain = 0.1;

/// Keeps the seconds a call of each run, in the order of registration.
class Collector : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      seconds.push_back(
          run.real_accumulated_time /
          static_cast<double>(std::max<benchmark::IterationCount>(1, run.iterations)));
    }
  }
  std::vector<double> seconds;
};

/// A function of OpenBLAS, or null where the BLAS in use is another one.
template <class Function>
Function* openblas(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_DEFAULT, name));
}

}  // namespace

std::string describe(const ThreadSetting& s) {
  if (s.threads == 1) return "1 thread";
  return fmt::format("{} threads, {} BLAS", s.threads, s.blas_threads == 1 ? "serial" : "threaded");
}

void apply(const ThreadSetting& setting) {
  // LibTorch asks OpenMP, too. Its own at::set_num_threads would start a new pool of threads every
  // time, which spin for some 20 ms and take a processor from what is measured.
  omp_set_num_threads(setting.threads);
  if (auto* set = openblas<void(int)>("openblas_set_num_threads")) set(setting.blas_threads);
  // The threads of OpenBLAS stay awake for a while; what comes next shall not share with them.
  static bool blas_awake = false;
  if (blas_awake) std::this_thread::sleep_for(std::chrono::milliseconds(40));
  blas_awake = setting.blas_threads > 1;
}

std::string blas_core_type() {
  auto* name = openblas<char*()>("openblas_get_corename");
  return name != nullptr ? name() : "unknown";
}

void Measurer::add(const std::string& name, Body body) {
  for (const int threads : {1, threads_}) {
    double& seconds = times_[name].emplace(threads, kInfinity).first->second;
    if (threads == 1 || threads_ > 1) work_.push_back({name, {threads, 1}, body, &seconds});
    if (threads_ == 1) break;
  }
}

void Measurer::add_baseline(const std::string& name, Body body) {
  std::vector<ThreadSetting> settings{{1, 1}};
  if (threads_ > 1) settings.insert(settings.end(), {{threads_, 1}, {threads_, threads_}});
  std::vector<Timed>& timed = baselines_[name];
  for (const ThreadSetting& s : settings) timed.push_back({s, kInfinity});
  for (Timed& t : timed) work_.push_back({name + "/plain", t.setting, body, &t.seconds});
}

void Measurer::run(const Effort& effort) {
  using Clock = std::chrono::steady_clock;
  for (int round = 0; round < effort.rounds; ++round) {
    throw_if_interrupted();
    benchmark::ClearRegisteredBenchmarks();
    std::vector<Work*> running;
    for (Work& work : work_) {
      if (round >= 2 && work.spent > effort.budget) continue;
      running.push_back(&work);
      benchmark::RegisterBenchmark(
          work.name.c_str(),
          [&work](benchmark::State& state) {
            apply(work.setting);
            const Clock::time_point start = Clock::now();
            for (auto _ : state) work.body();
            work.spent += std::chrono::duration<double>(Clock::now() - start).count();
          })
          ->MinTime(std::max(effort.seconds, 1e-9))
          ->UseRealTime();
    }
    if (running.empty()) break;
    Collector collector;
    benchmark::RunSpecifiedBenchmarks(&collector);
    if (collector.seconds.size() != running.size()) {
      throw Error(fmt::format("bench: expected {} times, found {}", running.size(),
                              collector.seconds.size()));
    }
    for (std::size_t i = 0; i < running.size(); ++i) {
      *running[i]->seconds = std::min(*running[i]->seconds, collector.seconds[i]);
    }
  }
  benchmark::ClearRegisteredBenchmarks();
  work_.clear();
  apply({threads_, threads_});
}

double Measurer::seconds(const std::string& name, int threads) const {
  return times_.at(name).at(threads);
}

Measurer::Best Measurer::baseline(const std::string& name) const {
  const std::vector<Timed>& timed = baselines_.at(name);
  // Work that more threads hardly make faster is work of one thread, and compared with one.
  const auto handicap = [](const Timed& t) {
    return t.seconds * (t.setting.threads > 1 ? 1 + kThreadsMustGain : 1);
  };
  const auto best = std::min_element(timed.begin(), timed.end(), [&](const auto& a, const auto& b) {
    return handicap(a) < handicap(b);
  });
  return {best->seconds, best->setting};
}

}  // namespace uniphy::bench
