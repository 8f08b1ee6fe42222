#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace uniphy::bench {

/// How many threads the work may take: OpenMP and LibTorch, and the BLAS behind LibTorch.
struct ThreadSetting {
  int threads = 1;
  int blas_threads = 1;
};
/// "1 thread", "2 threads, serial BLAS", "2 threads, threaded BLAS".
std::string describe(const ThreadSetting& setting);
void apply(const ThreadSetting& setting);
/// The kernels that OpenBLAS chose for this CPU ("Cooperlake"); "unknown" for any other BLAS.
std::string blas_core_type();

/// How long to measure: every round runs all registered work once, each for at least `seconds`;
/// work that has taken `budget` seconds in two rounds or more is left out of the later ones.
struct Effort {
  int rounds = 30;
  double seconds = 0.003;
  double budget = 4;
};

/// Times work with Google Benchmark. The rounds walk over everything that is registered, so that a
/// disturbance of the machine hits what is compared alike, and the shortest time of a round counts:
/// on a machine that does other things besides, the mean measures those, and a few milliseconds are
/// more likely to pass undisturbed than many.
class Measurer {
 public:
  using Body = std::function<void()>;

  explicit Measurer(int threads) : threads_(threads) {}

  /// Work of this project, on one thread and on all.
  void add(const std::string& name, Body body);
  /// The plain-tensor version of the work of the same name: under every sensible setting.
  void add_baseline(const std::string& name, Body body);
  /// Runs and forgets what was registered; times stay. Called once for each group of work.
  void run(const Effort& effort);

  /// Seconds a call.
  double seconds(const std::string& name, int threads) const;
  struct Best {
    double seconds;
    ThreadSetting setting;
  };
  bool has_baseline(const std::string& name) const { return baselines_.count(name) > 0; }
  /// The fastest setting, one of several threads only where that gains a tenth.
  Best baseline(const std::string& name) const;
  int threads() const { return threads_; }

 private:
  struct Work {
    std::string name;
    ThreadSetting setting;
    Body body;
    double* seconds;
    double spent = 0;
  };
  int threads_;
  std::vector<Work> work_;
  std::map<std::string, std::map<int, double>> times_;
  struct Timed {
    ThreadSetting setting;
    double seconds;
  };
  std::map<std::string, std::vector<Timed>> baselines_;
};

}  // namespace uniphy::bench
