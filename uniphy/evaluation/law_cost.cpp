#include "uniphy/evaluation/law_cost.hpp"

#include <time.h>

#include <algorithm>
#include <limits>

namespace uniphy {
namespace {

constexpr std::int64_t kStates = 1024;
constexpr int kRepetitions = 200;

/// Of this thread alone: what others do meanwhile is not the law's cost.
double cpu_nanoseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

}  // namespace

double law_cost(const kernels::LawDescription& description, const Dataset& states) {
  const std::int64_t all = states.samples.size(), count = std::min(kStates, all);
  if (count == 0) return std::numeric_limits<double>::quiet_NaN();
  // Spread over the data set, so that all materials are there.
  std::vector<double> F, C;
  for (std::int64_t k = 0; k < count; ++k) {
    const auto at = 9 * (k * all / count);
    F.insert(F.end(), states.samples.F.begin() + at, states.samples.F.begin() + at + 9);
    C.insert(C.end(), states.samples.C.begin() + at, states.samples.C.begin() + at + 9);
  }
  std::vector<double> F_proj(F.size()), tau(F.size());
  const auto law = kernels::make_law<double>(description);
  const double dt = states.trajectories.front().dt;
  double best = std::numeric_limits<double>::infinity();
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    const double start = cpu_nanoseconds();
    for (std::int64_t k = 0; k < count; k += kernels::kLawChunk) {
      const auto at = 9 * k;
      law->evaluate(std::min<std::ptrdiff_t>(kernels::kLawChunk, count - k), dt,
                    {F.data() + at, 9, 1}, {C.data() + at, 9, 1}, {F_proj.data() + at, 9, 1},
                    {tau.data() + at, 9, 1});
    }
    best = std::min(best, (cpu_nanoseconds() - start) / static_cast<double>(count));
  }
  return best;
}

}  // namespace uniphy
