#include "uniphy/inference/best_end.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Ends beside the best start; iterations of each at a horizon, and of the better half after those.
/// A law that is not settled at one horizon may be too far off for the next.
constexpr int kEnds = 4;
constexpr int kStarts = 6;  // of schedule_of_starts: the best, and one of each family
constexpr int kIterations = 2;
constexpr int kIterationsAhead = 4;
/// Share of the loss that an iteration has to take away for another.
constexpr double kLeastGain = 0.01;

struct Runner {
  SettledEnd at;
  std::size_t number;
  double loss = std::numeric_limits<double>::infinity();
};

void run(Runner& r, RungFitter& fitter, std::ptrdiff_t frames, double pull, const std::string& task,
         int iterations, bool moves_starts) {
  FitEnd& end = r.at.end;
  const Tensor from = torch::tensor(end.u, torch::kFloat64);
  fitter.set_motion(end.motion);
  const LeastSquaresEnd to = fitter.least_squares(r.at.seen, frames, Rung::latent, from, from, pull,
                                                  task, iterations, FitVelocity::yes, kLeastGain);
  end.u.assign(to.point.data_ptr<double>(), to.point.data_ptr<double>() + to.point.numel());
  end.motion = fitter.motion();
  r.loss = to.loss;
  if (!moves_starts || !std::isfinite(r.loss)) return;
  try {
    const Observation part = first_frames(r.at.seen, frames);
    r.at.seen = with_corrected_starts(r.at.seen, fitter.start_shift(part, Rung::latent, to.point));
  } catch (const Error&) {  // points leave the grid with this law: it keeps its starts
  }
}

}  // namespace

FitOptions schedule_to_ends(FitOptions options) {
  if (options.stages.size() > 1) {
    FitStage& last = options.stages.back();
    last.epochs = 0;
    last.candidates = std::min(kEnds, (options.stages.end() - 2)->candidates);
  }
  return options;
}

FitOptions schedule_of_starts(FitOptions options) {
  FitStage last = options.stages.back();
  last.epochs = 0;
  last.candidates = kStarts;
  options.detail = CloudDetail::rough;
  options.stages = {last};
  return options;
}

SettledEnd best_end(RungFitter& fitter, const Observation& seen, const std::vector<FitEnd>& ends,
                    const std::vector<std::ptrdiff_t>& horizons, double pull, bool moves_starts) {
  std::vector<Runner> runners;
  for (const FitEnd& end : ends) {
    if (!runners.empty() && runners.front().at.end.u == end.u) continue;  // the best start again
    runners.push_back({{end, seen}, runners.size() + 1});
  }
  for (std::size_t s = 0; s < horizons.size() && runners.size() > 1; ++s) {
    const auto all_run = [&](const char* name, int iterations) {
      for (Runner& r : runners) {
        run(r, fitter, horizons[s], pull, fmt::format("{} {}, horizon {}", name, r.number, s + 1),
            iterations, moves_starts);
      }
    };
    all_run("end", kIterations);
    std::stable_sort(runners.begin(), runners.end(),
                     [](const Runner& a, const Runner& b) { return a.loss < b.loss; });
    runners.erase(runners.begin() + static_cast<std::ptrdiff_t>((runners.size() + 1) / 2),
                  runners.end());
    if (s + 1 < horizons.size()) all_run("better end", kIterationsAhead);
  }
  return runners.front().at;
}

}  // namespace uniphy
