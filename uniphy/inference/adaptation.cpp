#include "uniphy/inference/adaptation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "ops/base/torch.hpp"
#include "uniphy/inference/candidate_fit.hpp"
#include "uniphy/inference/code_fit.hpp"
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

  /// z alone, as without a ladder.
  Climber fit_latent() {
    CodeEnd end = fit_code(fitter_, {part_, name_, latent_, options_, adaptation_, hooks_,
                                     fits_starts_, enough_, least_pull()});
    result_.fit = std::move(end.fit);
    explained_ = end.explained;
    part_ = end.seen;
    observation_.body = part_.body;  // the starts of all that is fitted from now on
    observation_.tracers = part_.tracers;
    Climber c{latent_.label(result_.fit.start), end.point, {}};
    conclude(c, Rung::latent);
    return c;
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

  /// The horizons of the schedule, and all of the observation.
  std::vector<std::ptrdiff_t> all_horizons() const {
    std::vector<std::ptrdiff_t> frames =
        growing_horizons(options_, result_.fit.contact, part_.frames);
    if (frames.back() < observation_.frames) frames.push_back(observation_.frames);
    return frames;
  }

  /// Half of the climbers go on to the next horizon, those that forecast best up to it.
  Climber fit_numbers(const Climber& code) {
    std::vector<Climber> climbers = first_climbers(code);
    for (Climber& c : climbers) c.start = c.point;
    const std::vector<std::ptrdiff_t> horizons = all_horizons();
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
      observation_ =
          with_corrected_starts(observation_, fitter_.start_shift(observation_, rung, last.point));
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
