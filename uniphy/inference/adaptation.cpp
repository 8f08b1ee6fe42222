#include "uniphy/inference/adaptation.hpp"

#include <fmt/format.h>
#include <torch/torch.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/inference/rung_fit.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Iterations that show which start is worth going on with.
constexpr int kTrialIterations = 4;
/// Iterations, and the share of the epochs, of the last fit to the whole observation: it begins
/// next to where it ends.
constexpr int kLastIterations = 4;
constexpr int kLastShare = 4;

/// A law on its way up, with what it comes to.
struct Climber {
  std::string name;  ///< material of its start
  Tensor point;      ///< of the variables of its rung
  double fitted = kInfinity, kept = kInfinity;
};

double root_mean_square(const std::vector<double>& x, std::ptrdiff_t begin, std::ptrdiff_t end) {
  double sum = 0;
  for (std::ptrdiff_t i = begin; i < end; ++i) sum += x[i] * x[i];
  return std::sqrt(sum / static_cast<double>(end - begin));
}

class Ladder {
 public:
  Ladder(const Observation& observation, const std::string& name, const FitVariables& latent,
         const FitOptions& options, const AdaptationOptions& adaptation, const FitHooks& hooks,
         std::ptrdiff_t fitted_frames)
      : observation_(observation),
        part_(first_frames(observation, fitted_frames)),
        name_(name),
        latent_(latent),
        options_(options),
        adaptation_(adaptation),
        hooks_(hooks),
        state_(adaptation_state_file(hooks.state_file), hooks),
        size_(observed_size(observation)),
        enough_(std::hypot(adaptation.enough, 2 * observed_noise(observation) / size_)) {
    for (const Rung rung : {Rung::latent, Rung::numbers, Rung::weights}) {
      variables_.push_back(std::make_unique<AdaptedVariables>(latent, rung));
    }
  }

  Adaptation run() {
    fit_latent();
    Climber best = latent_best_;
    for (const Rung rung : adaptation_.rungs) {
      if (rung == Rung::latent) continue;
      if (explained(best)) break;
      const Climber next = rung == Rung::numbers ? fit_numbers() : fit_weights(best);
      if (!pays(next, best)) break;
      best = next;
      result_.rung = rung;
    }
    finish(best);
    return result_;
  }

 private:
  AdaptedVariables& variables(Rung rung) const { return *variables_[static_cast<int>(rung)]; }
  bool explained(const Climber& c) const { return std::max(c.fitted, c.kept) <= enough_; }

  bool pays(const Climber& next, const Climber& best) const {
    return std::isfinite(next.kept) && next.kept <= (1 - adaptation_.gain) * best.kept;
  }

  /// Options of a rung. Differences of roll-outs want float64.
  FitOptions rung_options(bool differences) const {
    FitOptions o = options_;
    if (differences) o.dtype = "float64";
    o.rollout = "fused";
    o.pull = adaptation_.pull;
    o.refine_velocity = false;
    o.stages = {FitStage()};
    return o;
  }

  /// A task on a rung, with its progress, its state on disk and the work added to the report.
  template <class Improve>
  Tensor work(Rung rung, const std::string& task_name, int steps, const Improve& improve) {
    RungTask& task = state_.task(fmt::format("{} {}", rung_name(rung), task_name));
    std::optional<Progress> progress;
    if (hooks_.progress && !task.done) progress.emplace(task.name, steps, "roll-outs");
    const Tensor point = improve(task, [&](const RungTask& at, double loss) {
      const double root = std::sqrt(loss);
      if (hooks_.on_record) {
        hooks_.on_record(
            {static_cast<std::int32_t>(options_.stages.size()) + static_cast<std::int32_t>(rung), 0,
             at.steps, kInfinity, loss * size_ * size_});
      }
      state_.checkpoint(at.done);
      if (progress) progress->update(at.roll_outs, fmt::format("root/size {:.2e}", root));
    });
    report(rung).roll_outs += task.roll_outs;
    report(rung).seconds += task.seconds;
    return point;
  }

  RungReport& report(Rung rung) {
    for (RungReport& r : result_.rungs) {
      if (r.rung == rung) return r;
    }
    result_.rungs.emplace_back().rung = rung;
    return result_.rungs.back();
  }

  /// On the first `frames` of what is seen.
  Tensor least_squares_on(const Observation& seen, std::ptrdiff_t frames, Rung rung,
                          const Tensor& start, const std::string& task, int iterations) {
    const FitOptions options = rung_options(true);
    const FitProblem problem(seen, name_, variables(rung), options, &result_.fit.motion);
    const int roll_outs = iterations * (variables(rung).size() + 4);
    return work(rung, task, roll_outs, [&](RungTask& t, const AfterStep& after) {
      return least_squares(problem, start, frames, iterations, t, after);
    });
  }

  Tensor descent_on(const Observation& seen, const Tensor& start, const std::string& task,
                    int epochs) {
    const FitOptions options = rung_options(false);
    const FitProblem problem(seen, name_, variables(Rung::weights), options, &result_.fit.motion);
    const DescentOptions descent{adaptation_.optimizer, adaptation_.rate, epochs, options_.clip,
                                 options_.patience};
    return work(Rung::weights, task, epochs, [&](RungTask& t, const AfterStep& after) {
      return descend(problem, start, descent, t, after);
    });
  }

  /// Root of the mean square error of a law over size, of each frame.
  std::vector<double> roots(const Tensor& point, Rung rung, std::ptrdiff_t frames) const {
    const FitOptions options = rung_options(true);
    const FitProblem whole(observation_, name_, variables(rung), options, &result_.fit.motion);
    FitCandidate candidate = whole.candidate(0);
    candidate.u = point;
    std::vector<double> root = whole.frame_mse(candidate, frames);
    for (double& r : root) r = std::sqrt(r) / size_;
    return root;
  }

  /// The errors of the two parts.
  void judge(Climber& c, Rung rung) const {
    const std::vector<double> root = roots(c.point, rung, observation_.frames);
    c.fitted = root_mean_square(root, 0, part_.frames);
    c.kept = root_mean_square(root, part_.frames, observation_.frames);
  }

  void conclude(const Climber& c, Rung rung) {
    report(rung).fitted = c.fitted;
    report(rung).kept = c.kept;
  }

  /// z as without a ladder, and, where that does not do, from the best start of each other
  /// material.
  void fit_latent() {
    RungTask& task = state_.task("latent");
    const auto begin = std::chrono::steady_clock::now();
    result_.fit = fit_observation(part_, name_, latent_, options_, hooks_);
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    if (!task.done) {
      task.seconds = time.count();
      task.roll_outs = static_cast<int>(result_.fit.history.size()) + latent_.starts();
      task.done = true;
      state_.checkpoint(true);
    }
    report(Rung::latent).roll_outs += task.roll_outs;
    report(Rung::latent).seconds += task.seconds;
    latent_best_.name = latent_.label(result_.fit.start);
    latent_best_.point = least_squares_on(part_, part_.frames, Rung::latent,
                                          torch::tensor(result_.fit.u, torch::kFloat64), "z",
                                          adaptation_.iterations);
    judge(latent_best_, Rung::latent);
    conclude(latent_best_, Rung::latent);
  }

  /// The best start of every material but that of the fit.
  std::vector<int> other_starts() const {
    std::map<std::string, int> best;
    const std::vector<double>& mse = result_.fit.start_mse;
    for (int i = 0; i < latent_.starts(); ++i) {
      if (!std::isfinite(mse[i])) continue;
      const auto [at, added] = best.emplace(latent_.label(i), i);
      if (!added && mse[i] < mse[at->second]) at->second = i;
    }
    best.erase(latent_.label(result_.fit.start));
    std::vector<int> starts;
    for (const auto& [label, i] : best) starts.push_back(i);
    return starts;
  }

  /// From the fitted code and from the best start of every other material, over horizons that grow
  /// as those of the schedule do. Half of them go on, those that forecast best up to the next one.
  Climber fit_numbers() {
    const AdaptedVariables &from = variables(Rung::latent), &to = variables(Rung::numbers);
    std::vector<Climber> climbers{{latent_best_.name, to.widened(from, latent_best_.point)}};
    for (const int i : other_starts()) {
      climbers.push_back({latent_.label(i), torch::tensor(to.start(i), torch::kFloat64)});
    }
    std::vector<std::ptrdiff_t> horizons;
    for (const FitStage& stage : options_.stages) {
      horizons.push_back(horizon_frames(stage.horizon, result_.fit.contact, part_.frames));
    }
    horizons.push_back(observation_.frames);
    for (std::size_t s = 0; s + 1 < horizons.size(); ++s) {
      for (Climber& c : climbers) {
        c.point = least_squares_on(part_, horizons[s], Rung::numbers, c.point,
                                   fmt::format("{} {}", c.name, s + 1), kTrialIterations);
        const std::vector<double> root = roots(c.point, Rung::numbers, horizons[s + 1]);
        c.kept = root_mean_square(root, horizons[s], horizons[s + 1]);
      }
      std::stable_sort(climbers.begin(), climbers.end(),
                       [](const Climber& a, const Climber& b) { return a.kept < b.kept; });
      climbers.resize((climbers.size() + 1) / 2);
    }
    Climber best = climbers.front();
    best.point = least_squares_on(part_, part_.frames, Rung::numbers, best.point, best.name,
                                  adaptation_.iterations);
    judge(best, Rung::numbers);
    conclude(best, Rung::numbers);
    return best;
  }

  Climber fit_weights(const Climber& below) {
    const AdaptedVariables& from = variables(result_.rung);
    Climber c{below.name, variables(Rung::weights).widened(from, below.point)};
    c.point = descent_on(part_, c.point, c.name, adaptation_.epochs);
    judge(c, Rung::weights);
    conclude(c, Rung::weights);
    return c;
  }

  /// Fits the rung chosen to the whole observation.
  void finish(const Climber& best) {
    const std::vector<RungReport> reports = result_.rungs;  // what decided, without this fit
    const AdaptedVariables& chosen = variables(result_.rung);
    Tensor point = best.point;
    if (result_.rung == Rung::weights) {
      point = descent_on(observation_, point, "of all frames",
                         std::max(1, adaptation_.epochs / kLastShare));
    } else {
      point = least_squares_on(observation_, observation_.frames, result_.rung, point,
                               "of all frames", kLastIterations);
    }
    FitResult& fit = result_.fit;
    fit.law = chosen.law(point);
    const Tensor code = chosen.code(point).contiguous();
    fit.u.assign(code.data_ptr<double>(), code.data_ptr<double>() + code.numel());
    Climber last{best.name, point};
    judge(last, result_.rung);
    const double parts[] = {last.fitted, last.kept};
    const double share = double(part_.frames) / double(observation_.frames);
    fit.mse = size_ * size_ * (share * parts[0] * parts[0] + (1 - share) * parts[1] * parts[1]);
    for (const RungReport& r : reports) {
      report(r.rung).fitted = r.fitted;
      report(r.rung).kept = r.kept;
    }
  }

  const Observation& observation_;
  const Observation part_;  ///< what is fitted until the rung is chosen
  const std::string& name_;
  const FitVariables& latent_;
  const FitOptions& options_;
  const AdaptationOptions& adaptation_;
  const FitHooks& hooks_;
  AdaptationState state_;
  double size_, enough_;
  std::vector<std::unique_ptr<AdaptedVariables>> variables_;  ///< of each rung
  Climber latent_best_;
  Adaptation result_;
};

}  // namespace

Observation first_frames(const Observation& observation, std::ptrdiff_t frames) {
  Observation part = observation;
  part.frames = frames;
  part.time.resize(static_cast<std::size_t>(frames));
  part.x.resize(static_cast<std::size_t>(3 * frames * observation.particles));
  return part;
}

Adaptation adapt(const Observation& observation, const std::string& name,
                 const FitVariables& variables, const FitOptions& options,
                 const AdaptationOptions& adaptation, const FitHooks& hooks) {
  const FitProblem problem(observation, name, variables, options);
  const std::ptrdiff_t frames = observation.frames, contact = problem.contact();
  const std::ptrdiff_t fitted =
      std::min(horizon_frames(1 - adaptation.kept, contact, frames), frames - 1);
  if (contact >= fitted || adaptation.rungs.size() < 2 || !can_be_adapted(variables)) {
    Adaptation result;
    result.fit = fit_observation(observation, name, variables, options, hooks);
    return result;
  }
  return Ladder(observation, name, variables, options, adaptation, hooks, fitted).run();
}

std::string rung_table(Rung chosen, const std::vector<RungReport>& rungs) {
  if (rungs.empty()) return "";
  std::string text = fmt::format("{:<9} {:>10} {:>10} {:>9} {:>8}\n", "rung", "fitted", "kept",
                                 "roll-outs", "seconds");
  for (const RungReport& r : rungs) {
    text += fmt::format("{:<9} {:>8.4f} % {:>8.4f} % {:>9} {:>8.1f}{}\n", rung_name(r.rung),
                        100 * r.fitted, 100 * r.kept, r.roll_outs, r.seconds,
                        r.rung == chosen ? "  chosen" : "");
  }
  return text;
}

}  // namespace uniphy
