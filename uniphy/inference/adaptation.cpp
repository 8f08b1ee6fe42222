#include "uniphy/inference/adaptation.hpp"

#include <fmt/format.h>
#include <torch/torch.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include "uniphy/inference/best_end.hpp"
#include "uniphy/inference/candidate_fit.hpp"
#include "uniphy/inference/misfit.hpp"
#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/inference/rung_fitter.hpp"
#include "uniphy/inference/term_split.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Iterations at each horizon that show which start is worth going on with: of water and jelly,
/// begun from codes of other materials, the right ones are ahead after three.
constexpr int kTrialIterations = 4;
/// Fits of z between which the starts of noisy points are moved to where the last one has them: the
/// flow that says where is that of the fit before.
constexpr int kStartRounds = 6;
/// Iterations of those after the first.
constexpr int kRoundIterations = 4;
/// Share of the loss that a round has to take away for another.
constexpr double kRoundGain = 1e-3;
/// Iterations, and the share of the epochs, of the last fit to the whole observation: it begins
/// next to where it ends.
constexpr int kLastIterations = 4;
constexpr int kLastShare = 4;

/// A law on its way up, with what it comes to.
struct Climber {
  std::string name;
  Tensor point;  ///< of the variables of its rung
  Tensor start;  ///< where it began there
  double fitted = kInfinity, kept = kInfinity;
};

Tensor to_tensor(const std::vector<double>& numbers) {
  return torch::tensor(numbers, torch::kFloat64);
}

double root_mean_square(const std::vector<double>& x, std::ptrdiff_t begin, std::ptrdiff_t end) {
  double sum = 0;
  for (std::ptrdiff_t i = begin; i < end; ++i) sum += x[i] * x[i];
  return std::sqrt(sum / static_cast<double>(end - begin));
}

class Ladder {
 public:
  Ladder(const Observation& observation, const std::string& name, const FitVariables& latent,
         const FitOptions& options, const AdaptationOptions& adaptation, const FitHooks& hooks,
         std::ptrdiff_t fitted_frames, bool fits_starts)
      : observation_(observation),
        part_(first_frames(observation, fitted_frames)),
        name_(name),
        latent_(latent),
        options_(options),
        adaptation_(adaptation),
        hooks_(hooks),
        fitted_frames_(fitted_frames),
        fits_starts_(fits_starts),
        deformed_(observation.start_degree > 0),
        clouds_(observation.cloud > 0),
        from_ends_(fits_starts_ || deformed_ || clouds_),
        fitter_(observation_, name, latent, options, adaptation, hooks),
        noise_(observed_noise(observation) / fitter_.size()),
        enough_(std::hypot(adaptation.enough, (fits_starts ? kNoiseAllowance : 2) * noise_)) {}

  Adaptation run() {
    Climber best = fit_latent();
    result_.seen = observation_;
    result_.starts_fitted = fits_starts_;
    if (fitted_frames_ == observation_.frames) return only_latent(best);
    for (const Rung rung : adaptation_.rungs) {
      if (rung == Rung::latent) continue;
      if (std::max(best.fitted, best.kept) <= enough_) break;
      const Climber next = rung == Rung::numbers ? fit_numbers(best) : fit_weights(best);
      if (!pays(next, best) || !fitter_.lasts(next.point, rung)) break;
      best = next;
      result_.rung = rung;
    }
    finish(best);
    return result_;
  }

 private:
  bool pays(const Climber& next, const Climber& best) const {
    return std::isfinite(next.kept) && next.kept <= (1 - adaptation_.gain) * best.kept;
  }

  double least_pull() const {
    return uniphy::least_pull(noise_, 3.0 * double(observation_.points()) * double(part_.frames));
  }

  /// The errors of the two parts.
  void judge(Climber& c, Rung rung) const {
    const std::vector<double> root = fitter_.roots(c.point, rung, observation_.frames);
    c.fitted = root_mean_square(root, 0, part_.frames);
    if (part_.frames < observation_.frames)
      c.kept = root_mean_square(root, part_.frames, observation_.frames);
  }

  /// The same, for the report.
  void conclude(Climber& c, Rung rung) {
    judge(c, rung);
    RungReport& report = fitter_.report(rung);
    report.fitted = c.fitted;
    report.kept = c.kept;
  }

  /// z as without a ladder, then by least squares.
  Climber fit_latent() {
    RungTask& task = fitter_.state().task("latent");
    const auto begin = std::chrono::steady_clock::now();
    result_.fit = fit_observation(part_, name_, latent_, schedule(), hooks_);
    const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
    if (!task.done) {
      task.seconds = time.count();
      task.roll_outs = static_cast<int>(result_.fit.history.size()) + latent_.starts();
      task.done = true;
      fitter_.state().checkpoint(true);
    }
    fitter_.report(Rung::latent).roll_outs += task.roll_outs;
    fitter_.report(Rung::latent).seconds += task.seconds;
    const bool converged = options_.stages.back().optimizer == kLevenbergMarquardt;
    const int rounds = from_ends_ ? kStartRounds : converged ? 0 : 1;
    FitEnd end = result_.fit.ends.front();
    if (from_ends_) {
      fitter_.set_detail(CloudDetail::rough);
      const SettledEnd best =
          best_end(fitter_, part_, result_.fit.ends, fitted_horizons(), least_pull(), fits_starts_);
      fitter_.set_detail(CloudDetail::all);
      end = best.end;
      take_starts(best.seen);
    }
    fitter_.set_motion(end.motion);
    result_.fit.start = end.start;
    Climber c{latent_.label(end.start), to_tensor(end.u), {}};
    double loss = kInfinity;
    Observation before = part_;  // the last one whose starts were moved
    for (int round = 0; round < rounds; ++round) {
      const std::string name = round == 0 ? "code" : fmt::format("code, round {}", round + 1);
      const InitialState motion = fitter_.motion();
      const LeastSquaresEnd to =
          fitter_.least_squares(part_, part_.frames, Rung::latent, c.point, c.point, least_pull(),
                                name, round == 0 ? adaptation_.iterations : kRoundIterations,
                                from_ends_ ? FitVelocity::yes : FitVelocity::held);
      if (round > 0 && !(to.loss < loss)) {  // the starts moved too far
        fitter_.set_motion(motion);
        take_starts(before);
        break;
      }
      c.point = to.point;
      const bool settled = !(to.loss < (1 - kRoundGain) * loss);
      loss = to.loss;
      if (!from_ends_) break;
      if (fits_starts_) {
        before = part_;
        move_starts(Rung::latent, c.point, part_);
      }
      if (settled) break;
    }
    explained_ = std::sqrt(loss) <= enough_;
    if (fits_starts_ && !explained_ && !deformed_) {  // what is left is of the law or the grid
      c.point =
          fitter_
              .least_squares(part_, part_.frames, Rung::latent, c.point, c.point, least_pull(),
                             "code, velocity held", kRoundIterations, FitVelocity::held)
              .point;
      move_starts(Rung::latent, c.point, part_);
    }
    conclude(c, Rung::latent);
    return c;
  }

  FitOptions schedule() const {
    if (deformed_ || clouds_) return schedule_of_starts(options_);
    return fits_starts_ ? schedule_to_ends(options_) : options_;
  }

  /// The starts of its points are those of all that is fitted from now on.
  void take_starts(const Observation& seen) {
    observation_.body = part_.body = seen.body;
    observation_.tracers = part_.tracers = seen.tracers;
  }

  void add_posterior(Rung rung, const Tensor& point) {
    if (adaptation_.samples == 0) return;
    result_.posterior = fitter_.posterior(observation_, rung, point);
    const FitVariables& variables =
        rung == Rung::latent ? latent_ : static_cast<const FitVariables&>(fitter_.variables(rung));
    for (const Tensor& sample : result_.posterior.samples) {
      result_.samples.push_back(variables.law(sample.slice(0, 0, variables.size()).contiguous()));
    }
  }

  /// Moves the starts of the points to where a law and the frames of `seen` have them.
  void move_starts(Rung rung, const Tensor& point, const Observation& seen) {
    observation_ = with_corrected_starts(observation_, fitter_.start_shift(seen, rung, point));
    part_ = first_frames(observation_, fitted_frames_);
  }

  /// All frames were fitted, and there is nothing to choose.
  Adaptation only_latent(const Climber& c) {
    FitResult& fit = result_.fit;
    fit.law = latent_.law(c.point);
    fit.u.assign(c.point.data_ptr<double>(), c.point.data_ptr<double>() + c.point.numel());
    fit.motion = fitter_.motion();
    fit.mse = c.fitted * c.fitted * fitter_.size() * fitter_.size();
    add_posterior(Rung::latent, c.point);
    count_roll_outs();
    return result_;
  }

  /// The best start of every material.
  std::map<std::string, int> best_starts() const {
    std::map<std::string, int> best;
    const std::vector<double>& mse = result_.fit.start_mse;
    for (int i = 0; i < latent_.starts(); ++i) {
      if (!std::isfinite(mse[i])) continue;
      const auto [at, added] = best.emplace(latent_.label(i), i);
      if (!added && mse[i] < mse[at->second]) at->second = i;
    }
    return best;
  }

  /// Where the law's own numbers are fitted from: the code and the best start of its material,
  /// their terms split, and the best start of every other material.
  std::vector<Climber> first_climbers(const Climber& code) const {
    const AdaptedVariables& to = fitter_.variables(Rung::numbers);
    std::vector<Climber> climbers;
    const auto add_split = [&](const std::string& name, const Tensor& point) {
      const std::vector<Tensor> apart = split_terms(to, point);
      for (std::size_t i = 0; i < apart.size(); ++i) {
        climbers.push_back({fmt::format("{} split {}", name, i + 1), apart[i], {}});
      }
    };
    const Tensor point = to.widened(fitter_.variables(Rung::latent), code.point);
    climbers.push_back({"code", point, {}});
    add_split("code", point);
    for (const auto& [material, i] : best_starts()) {
      const Tensor start = to_tensor(to.start(i));
      if (material == code.name) {
        add_split(material, start);
      } else {
        climbers.push_back({material, start, {}});
      }
    }
    return climbers;
  }

  /// Frames of the horizons of the schedule, growing.
  std::vector<std::ptrdiff_t> fitted_horizons() const {
    std::vector<std::ptrdiff_t> frames;
    for (const FitStage& stage : options_.stages) {
      frames.push_back(horizon_frames(stage.horizon, result_.fit.contact, part_.frames));
    }
    std::sort(frames.begin(), frames.end());
    frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
    return frames;
  }

  /// The same, and all of the observation.
  std::vector<std::ptrdiff_t> growing_horizons() const {
    std::vector<std::ptrdiff_t> frames = fitted_horizons();
    if (frames.back() < observation_.frames) frames.push_back(observation_.frames);
    return frames;
  }

  /// Half of the climbers go on to the next horizon, those that forecast best up to it.
  Climber fit_numbers(const Climber& code) {
    std::vector<Climber> climbers = first_climbers(code);
    for (Climber& c : climbers) c.start = c.point;
    const std::vector<std::ptrdiff_t> horizons = growing_horizons();
    double pull = kFirstPull;
    for (std::size_t s = 0; s + 1 < horizons.size(); ++s) {
      if (s > 0) pull *= kPullOfHorizons;
      for (Climber& c : climbers) {
        c.point =
            fitter_
                .least_squares(part_, horizons[s], Rung::numbers, c.point, c.start,
                               std::max(pull, least_pull()), fmt::format("{} {}", c.name, s + 1),
                               kTrialIterations, FitVelocity::no)
                .point;
        c.kept = root_mean_square(fitter_.roots(c.point, Rung::numbers, horizons[s + 1]),
                                  horizons[s], horizons[s + 1]);
      }
      std::stable_sort(climbers.begin(), climbers.end(),
                       [](const Climber& a, const Climber& b) { return a.kept < b.kept; });
      climbers.resize((climbers.size() + 1) / 2);
    }
    Climber best = climbers.front();
    for (int k = 1; pull > least_pull(); ++k) {
      pull = std::max(kPullOfFits * pull, least_pull());
      best.point = fitter_
                       .least_squares(part_, part_.frames, Rung::numbers, best.point, best.start,
                                      pull, fmt::format("{} last {}", best.name, k),
                                      adaptation_.iterations, FitVelocity::no)
                       .point;
    }
    conclude(best, Rung::numbers);
    return best;
  }

  Climber fit_weights(const Climber& below) {
    Climber c{
        below.name,
        fitter_.variables(Rung::weights).widened(fitter_.variables(result_.rung), below.point),
        {}};
    c.point = fitter_.descend(part_, c.point, c.name, adaptation_.epochs);
    conclude(c, Rung::weights);
    return c;
  }

  /// Fits the rung chosen to the whole observation. The reports keep what decided.
  void finish(const Climber& best) {
    const std::string task = "all frames";
    const Rung rung = result_.rung;
    const InitialState before = fitter_.motion();
    Climber last = best;
    last.point =
        rung == Rung::weights
            ? fitter_.descend(observation_, best.point, task,
                              std::max(1, adaptation_.epochs / kLastShare))
            : fitter_
                  .least_squares(observation_, observation_.frames, rung, best.point, best.point,
                                 least_pull(), task, kLastIterations,
                                 fits_starts_ && explained_ ? FitVelocity::yes : FitVelocity::held)
                  .point;
    if (rung != Rung::latent && !fitter_.lasts(last.point, rung)) {
      last.point = best.point;
      fitter_.set_motion(before);
    }
    if (fits_starts_ && rung != Rung::weights)
      move_starts(rung, last.point, Observation(observation_));
    result_.seen = observation_;
    const AdaptedVariables& chosen = fitter_.variables(rung);
    const Tensor code = chosen.code(last.point).contiguous();
    FitResult& fit = result_.fit;
    fit.law = chosen.law(last.point);
    fit.motion = fitter_.motion();
    fit.u.assign(code.data_ptr<double>(), code.data_ptr<double>() + code.numel());
    const double root = root_mean_square(fitter_.roots(last.point, rung, observation_.frames), 0,
                                         observation_.frames);
    fit.mse = root * root * fitter_.size() * fitter_.size();
    add_posterior(rung, last.point);
    result_.rungs = fitter_.reports();
    count_roll_outs();
  }

  void count_roll_outs() {
    for (const RungReport& r : fitter_.reports()) result_.roll_outs += r.roll_outs;
  }

  Observation observation_;  ///< with the starts that were found
  Observation part_;         ///< what is fitted until the rung is chosen
  const std::string& name_;
  const FitVariables& latent_;
  const FitOptions& options_;
  const AdaptationOptions& adaptation_;
  const FitHooks& hooks_;
  const std::ptrdiff_t fitted_frames_;
  const bool fits_starts_;
  const bool deformed_;   ///< at the first frame
  const bool clouds_;     ///< without correspondence
  const bool from_ends_;  ///< of gradients, least squares race: best_end
  RungFitter fitter_;
  double noise_, enough_;   ///< over size
  bool explained_ = false;  ///< by z alone, what is fitted of the observation
  Adaptation result_;
};

}  // namespace

Adaptation adapt(const Observation& observation, const std::string& name,
                 const FitVariables& variables, const FitOptions& options,
                 const AdaptationOptions& adaptation, const FitHooks& hooks) {
  const FitProblem problem(observation, name, variables, options);
  const std::ptrdiff_t frames = observation.frames, contact = problem.contact();
  std::ptrdiff_t fitted = frames;
  // What is left is of the polynomials of a deformed start, or of clouds: no reason for more laws.
  const bool by_code = observation.start_degree > 0 || observation.cloud > 0;
  if (adaptation.rungs.size() > 1 && can_be_adapted(variables) && !by_code) {
    fitted = std::min(horizon_frames(1 - adaptation.kept, contact, frames), frames - 1);
  }
  const bool climbs = fitted < frames && contact < fitted;
  if (contact >= frames) {
    Adaptation result;
    result.fit = fit_observation(observation, name, variables, options, hooks);
    result.seen = observation;
    result.roll_outs = static_cast<int>(result.fit.history.size()) + variables.starts();
    return result;
  }
  return Ladder(observation, name, variables, options, adaptation, hooks, climbs ? fitted : frames,
                problem.fits_starts())
      .run();
}

}  // namespace uniphy
