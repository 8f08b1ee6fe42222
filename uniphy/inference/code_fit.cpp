#include "uniphy/inference/code_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "ops/base/torch.hpp"
#include "uniphy/inference/best_end.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Fits of z between which the starts of noisy points are moved to where the last one has them: the
/// flow that says where is that of the fit before.
constexpr int kStartRounds = 6;
/// Iterations of those after the first.
constexpr int kRoundIterations = 4;
/// Share of the loss that a round has to take away for another.
constexpr double kRoundGain = 1e-3;

class CodeFit {
 public:
  CodeFit(RungFitter& fitter, const CodeProblem& problem)
      : fitter_(fitter),
        p_(problem),
        deformed_(problem.seen.start_degree > 0),
        clouds_(problem.seen.cloud > 0),
        from_ends_(problem.fits_starts || deformed_ || clouds_) {
    end_.seen = problem.seen;
  }

  CodeEnd run() {
    follow_schedule();
    FitEnd from = end_.fit.ends.front();
    if (from_ends_) {
      fitter_.set_detail(CloudDetail::rough);
      SettledEnd best = best_end(fitter_, end_.seen, end_.fit.ends,
                                 growing_horizons(p_.options, end_.fit.contact, end_.seen.frames),
                                 p_.least_pull, p_.fits_starts);
      fitter_.set_detail(CloudDetail::all);
      from = best.end;
      end_.seen = std::move(best.seen);
    }
    fitter_.set_motion(from.motion);
    end_.fit.start = from.start;
    end_.point = torch::tensor(from.u, torch::kFloat64);
    settle();
    return end_;
  }

 private:
  /// The schedule, whose roll-outs are those of the rung.
  void follow_schedule() {
    RungTask& task = fitter_.state().task("latent");
    const auto begin = std::chrono::steady_clock::now();
    end_.fit = fit_observation(end_.seen, p_.name, p_.variables, schedule(), p_.hooks);
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    if (!task.done) {
      task.seconds = time.count();
      task.roll_outs = static_cast<int>(end_.fit.history.size()) + p_.variables.starts();
      task.done = true;
      fitter_.state().checkpoint(true);
    }
    fitter_.report(Rung::latent).roll_outs += task.roll_outs;
    fitter_.report(Rung::latent).seconds += task.seconds;
  }

  FitOptions schedule() const {
    if (deformed_ || clouds_) return schedule_of_starts(p_.options);
    return p_.fits_starts ? schedule_to_ends(p_.options) : p_.options;
  }

  /// Least squares in rounds, until the starts stay where they are.
  void settle() {
    const bool converged = p_.options.stages.back().optimizer == kLevenbergMarquardt;
    const int rounds = from_ends_ ? kStartRounds : converged ? 0 : 1;
    double loss = std::numeric_limits<double>::infinity();
    Observation before = end_.seen;  // the last one whose starts were moved
    for (int round = 0; round < rounds; ++round) {
      const InitialState motion = fitter_.motion();
      const LeastSquaresEnd to =
          least_squares(round == 0 ? "code" : fmt::format("code, round {}", round + 1),
                        round == 0 ? p_.adaptation.iterations : kRoundIterations,
                        from_ends_ ? FitVelocity::yes : FitVelocity::held);
      if (round > 0 && !(to.loss < loss)) {  // the starts moved too far
        fitter_.set_motion(motion);
        end_.seen = before;
        break;
      }
      end_.point = to.point;
      const bool settled = !(to.loss < (1 - kRoundGain) * loss);
      loss = to.loss;
      if (!from_ends_) break;
      before = end_.seen;
      move_starts();
      if (settled) break;
    }
    end_.explained = std::sqrt(loss) <= p_.enough;
    if (!p_.fits_starts || end_.explained || deformed_) return;
    // What is left is of the law or the grid.
    end_.point = least_squares("code, velocity held", kRoundIterations, FitVelocity::held).point;
    move_starts();
  }

  LeastSquaresEnd least_squares(const std::string& task, int iterations, FitVelocity velocity) {
    return fitter_.least_squares(end_.seen, end_.seen.frames, Rung::latent, end_.point, end_.point,
                                 p_.least_pull, task, iterations, velocity);
  }

  void move_starts() {
    if (!p_.fits_starts) return;
    end_.seen =
        with_corrected_starts(end_.seen, fitter_.start_shift(end_.seen, Rung::latent, end_.point));
  }

  RungFitter& fitter_;
  const CodeProblem& p_;
  const bool deformed_, clouds_;
  const bool from_ends_;  ///< of the schedule, least squares race
  CodeEnd end_;
};

}  // namespace

CodeEnd fit_code(RungFitter& fitter, const CodeProblem& problem) {
  return CodeFit(fitter, problem).run();
}

std::vector<std::ptrdiff_t> growing_horizons(const FitOptions& options, std::ptrdiff_t contact,
                                             std::ptrdiff_t frames) {
  std::vector<std::ptrdiff_t> horizons;
  for (const FitStage& stage : options.stages)
    horizons.push_back(horizon_frames(stage.horizon, contact, frames));
  std::sort(horizons.begin(), horizons.end());
  horizons.erase(std::unique(horizons.begin(), horizons.end()), horizons.end());
  return horizons;
}

}  // namespace uniphy
