#include "uniphy/inference/several_bodies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <numeric>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/data/random_law.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/joint_fit.hpp"
#include "uniphy/inference/meeting.hpp"
#include "uniphy/inference/motion_objective.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/inference/start_correction.hpp"

namespace uniphy {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Of materials: all pairs and triples of five.
constexpr std::size_t kMostCombinations = 125;
/// Share of the time after all have met that combinations are compared over.
constexpr double kTrialHorizon = 0.5;
/// Fits of each body by itself, before all are fitted at once: in the first one the others still
/// have the laws of a whole family. Iterations of the last least squares of each.
constexpr int kRounds = 2;
constexpr int kRoundIterations = 4;

/// Of every material the start that is nearest to the mean of its starts.
std::vector<int> middle_starts(const FitVariables& variables) {
  bool named = false;
  for (int i = 0; i < variables.starts(); ++i) named = named || !is_random_law(variables.label(i));
  std::map<std::string, std::vector<int>> starts;
  for (int i = 0; i < variables.starts(); ++i) {
    if (named && is_random_law(variables.label(i))) continue;
    starts[variables.label(i)].push_back(i);
  }
  std::vector<int> middle;
  for (const auto& [material, of] : starts) {
    std::vector<double> mean(static_cast<std::size_t>(variables.size()));
    for (const int i : of) {
      const std::vector<double> u = variables.start(i);
      for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += u[k] / double(of.size());
    }
    const auto distance = [&](int i) {
      const std::vector<double> u = variables.start(i);
      double square = 0;
      for (std::size_t k = 0; k < mean.size(); ++k) square += (u[k] - mean[k]) * (u[k] - mean[k]);
      return square;
    };
    middle.push_back(*std::min_element(of.begin(), of.end(),
                                       [&](int a, int b) { return distance(a) < distance(b); }));
  }
  return middle;
}

/// A body as it is known between two fits.
struct Body {
  std::string name;         ///< for messages and files
  Observation observation;  ///< with known starts
  std::vector<double> u;    ///< empty: not fitted yet
  Companion self;           ///< as the others' roll-outs have it
  std::ptrdiff_t contact = 0;
  Adaptation fitted;
  bool explained = false;  ///< by the joint fit
  int rounds = 0;

  /// The others' roll-outs have it as it is fitted now.
  void take_over() {
    u = fitted.fit.u;
    self.law = fitted.fit.law;
    self.motion = fitted.fit.motion;
    self.x = fitted.seen.start();
  }
};

class BodiesFit {
 public:
  BodiesFit(const std::vector<ObservedBody>& observed, const std::string& name,
            const FitVariables& variables, const FitOptions& options, const FitHooks& hooks,
            const AdaptationOptions& adaptation)
      : name_(name),
        variables_(variables),
        options_(options),
        hooks_(hooks),
        adaptation_(adaptation),
        grid_(observed_grid(observed.front().motion, name)),
        middle_(middle_starts(variables)) {
    for (const ObservedBody& o : observed) {
      Body& b = bodies_.emplace_back();
      b.name = o.name;
      b.observation = with_known_starts(o.motion, message_name(b));
      b.self.x = b.observation.start();
      b.self.volume = b.observation.volume;
      b.self.density = b.observation.density;
      b.self.law = variables.law(variables.start(middle_.front()));
    }
    meet();
  }

  BodiesInference run() {
    std::map<int, std::vector<std::size_t>> groups;
    for (std::size_t b = 0; b < bodies_.size(); ++b) groups[group_[b]].push_back(b);
    for (const auto& [number, members] : groups) {
      if (members.size() > 1) fit_together(members);
      // Alone, or where more freedom than z is allowed and needed.
      if (members.size() == 1 || !joint_does(members)) last_fits(members);
    }
    return finish();
  }

 private:
  using Members = std::vector<std::size_t>;

  std::string message_name(const Body& b) const { return fmt::format("{}: {}", name_, b.name); }

  /// Where a body is at the frames: where it is seen, or where the laws of now take it.
  BodyPath path_of(std::size_t b) const {
    const Observation& o = bodies_[b].observation;
    if (is_complete(o)) return {o.frames, o.x};
    Observation particles = o;  // of which the positions are asked for
    particles.body = o.start();
    particles.tracers.clear();
    particles.cloud = 0;
    particles.x.clear();
    for (std::int64_t f = 0; f < o.frames; ++f)
      particles.x.insert(particles.x.end(), particles.body.begin(), particles.body.end());
    BodyPath path;
    try {
      objective_of(b, particles)
          ->simulate(bodies_[b].self.law, bodies_[b].self.motion,
                     [&](std::ptrdiff_t, const std::vector<double>& x) {
                       path.x.insert(path.x.end(), x.begin(), x.end());
                       ++path.frames;
                     });
    } catch (const Error&) {  // it leaves the grid: until there
    }
    return path;
  }

  /// Finds who meets whom and when, and what the bodies do before that.
  void meet() {
    for (Body& b : bodies_) {
      if (b.u.empty()) b.self.motion = first_motion(b);
    }
    std::vector<BodyPath> paths;
    for (std::size_t b = 0; b < bodies_.size(); ++b) paths.push_back(path_of(b));
    std::vector<std::vector<bool>> meets(bodies_.size(), std::vector<bool>(bodies_.size()));
    std::vector<double> meeting(bodies_.size(), kInfinity);
    for (std::size_t a = 0; a < bodies_.size(); ++a) {
      for (std::size_t b = a + 1; b < bodies_.size(); ++b) {
        const Observation &of_a = bodies_[a].observation, &of_b = bodies_[b].observation;
        std::int64_t frame = first_meeting(paths[a], paths[b], grid_);
        // Points that are seen tell it whatever the laws of now say.
        const std::int64_t seen =
            first_meeting({of_a.frames, of_a.x}, {of_b.frames, of_b.x}, grid_);
        if (seen >= 0) frame = frame < 0 ? seen : std::min(frame, seen);
        if (frame < 0) continue;
        meets[a][b] = meets[b][a] = true;
        const std::vector<double>& time = of_a.time;
        for (const std::size_t k : {a, b})
          meeting[k] = std::min(meeting[k], time[std::max<std::int64_t>(frame - 1, 0)] - time[0]);
      }
    }
    group_ = meeting_groups(meets);
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      Body& b = bodies_[k];
      b.observation.meeting = meeting[k];
      if (b.u.empty()) b.self.motion = first_motion(b);
      b.contact = first_contact(b.observation, steps_of(b), grid_, b.self.motion);
    }
  }

  ObservedSteps steps_of(const Body& b) const {
    return observed_steps(b.observation, message_name(b));
  }
  InitialState first_motion(const Body& b) const {
    return observed_motion(b.observation, steps_of(b), grid_);
  }

  std::vector<Companion> companions_of(std::size_t b) const {
    std::vector<Companion> others;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      if (k != b && !group_.empty() && group_[k] == group_[b]) others.push_back(bodies_[k].self);
    }
    return others;
  }
  std::unique_ptr<const MotionObjective> objective_of(std::size_t b, const Observation& o) const {
    return make_motion_objective(o, steps_of(bodies_[b]), grid_, options_.dtype, "fused",
                                 CloudDetail::rough, companions_of(b));
  }

  /// Mean of the errors over size² of the members up to a frame, by the laws of now.
  double error_of(const Members& members, std::ptrdiff_t frames) const {
    double sum = 0;
    for (const std::size_t b : members) {
      const Observation& o = bodies_[b].observation;
      const std::vector<double> mse =
          objective_of(b, o)->frame_mse(bodies_[b].self.law, bodies_[b].self.motion, frames);
      const double size = observed_size(o);
      sum += mean_of_first(mse, frames) / (size * size * double(members.size()));
      if (!std::isfinite(sum)) break;
    }
    return sum;
  }

  void set_start(std::size_t b, int start) {
    bodies_[b].self.law = variables_.law(variables_.start(start));
  }

  /// The best combination of the middle starts.
  void choose_laws(const Members& members) {
    std::ptrdiff_t contact = 0;
    for (const std::size_t b : members) contact = std::max(contact, bodies_[b].contact);
    const std::ptrdiff_t frames =
        horizon_frames(kTrialHorizon, contact, bodies_[members.front()].observation.frames);
    double combinations = std::pow(double(middle_.size()), double(members.size()));
    std::vector<int> best(members.size(), middle_.front());
    if (combinations <= double(kMostCombinations)) {
      double least = kInfinity;
      for (int c = 0; c < static_cast<int>(combinations); ++c) {
        std::vector<int> now;
        for (int rest = c; now.size() < members.size(); rest /= int(middle_.size()))
          now.push_back(middle_[std::size_t(rest) % middle_.size()]);
        for (std::size_t k = 0; k < members.size(); ++k) set_start(members[k], now[k]);
        const double error = error_of(members, frames);
        if (!(error < least)) continue;
        least = error;
        best = now;
      }
    } else {
      for (std::size_t k = 0; k < members.size(); ++k) {
        double least = kInfinity;
        for (const int start : middle_) {
          set_start(members[k], start);
          const double error = error_of(members, frames);
          if (!(error < least)) continue;
          least = error;
          best[k] = start;
        }
        set_start(members[k], best[k]);
      }
    }
    for (std::size_t k = 0; k < members.size(); ++k) set_start(members[k], best[k]);
  }

  Members in_order_of_contact(Members members) const {
    std::stable_sort(members.begin(), members.end(), [&](std::size_t a, std::size_t b) {
      return bodies_[a].contact < bodies_[b].contact;
    });
    return members;
  }

  void fit_together(const Members& members) {
    choose_laws(members);
    AdaptationOptions latent = adaptation_;
    latent.rungs = {Rung::latent};
    latent.iterations = std::min(kRoundIterations, latent.iterations);
    latent.samples = 0;
    for (int round = 0; round < kRounds; ++round) {
      for (const std::size_t b : in_order_of_contact(members)) fit(b, latent);
    }
    fit_jointly(members);
  }

  /// Whether the joint fit is the last word: it explains all motions, or nothing else may be tried.
  bool joint_does(const Members& members) const {
    const bool climbs = adaptation_.rungs.size() > 1 && can_be_adapted(variables_);
    return std::all_of(members.begin(), members.end(),
                       [&](std::size_t b) { return bodies_[b].explained || !climbs; });
  }

  void fit_jointly(const Members& members) {
    std::vector<JointBody> bodies;
    for (const std::size_t k : members) {
      const Body& b = bodies_[k];
      JointBody& j = bodies.emplace_back();
      j.name = message_name(b);
      j.seen = b.fitted.seen;
      j.u = torch::tensor(b.u, torch::kFloat64);
      j.motion = b.self.motion;
    }
    FitHooks hooks = hooks_;
    if (!hooks.state_file.empty())
      hooks.state_file.replace_extension(fmt::format(".group{}.h5", group_[members.front()]));
    hooks.fingerprint = fmt::format("{} group {}", hooks_.fingerprint, group_[members.front()]);
    JointFit joint(std::move(bodies), variables_, options_, adaptation_, hooks);
    if (!joint.state_file().empty()) state_files_.push_back(joint.state_file());
    joint.run();
    for (std::size_t i = 0; i < members.size(); ++i)
      bodies_[members[i]].explained = joint.bodies()[i].explained();
    if (joint_does(members)) joint.add_posterior();
    for (std::size_t i = 0; i < members.size(); ++i)
      take(joint.bodies()[i], joint.roll_outs(), bodies_[members[i]]);
  }

  /// What the joint fit came to.
  void take(const JointBody& found, int roll_outs, Body& b) const {
    Adaptation& a = b.fitted;
    a.seen = found.seen;
    a.roll_outs += roll_outs;
    const double size = observed_size(found.seen);
    FitResult& fit = a.fit;
    fit.u.assign(found.u.data_ptr<double>(), found.u.data_ptr<double>() + found.u.numel());
    fit.law = variables_.law(fit.u);
    fit.motion = found.motion;
    fit.mse = found.loss * size * size;
    a.posterior = found.posterior;
    a.samples.clear();
    for (const torch::Tensor& sample : found.posterior.samples)
      a.samples.push_back(variables_.law(sample.slice(0, 0, variables_.size()).contiguous()));
    b.take_over();
  }

  void last_fits(const Members& members) {
    for (const std::size_t b : in_order_of_contact(members)) fit(b, adaptation_);
  }

  void fit(std::size_t k, const AdaptationOptions& adaptation) {
    Body& b = bodies_[k];
    ++b.rounds;
    if (hooks_.progress) {
      std::fprintf(stderr, "%s: fit %d\n", b.name.c_str(), b.rounds);
    }
    FitOptions options = options_;
    options.companions = companions_of(k);
    FitHooks hooks = hooks_;
    if (!hooks.state_file.empty()) {
      hooks.state_file.replace_extension(fmt::format(".{}.{}.h5", k, b.rounds));
      state_files_.push_back(hooks.state_file);
      state_files_.push_back(adaptation_state_file(hooks.state_file));
    }
    hooks.fingerprint = fmt::format("{} {} {}", hooks_.fingerprint, k, b.rounds);
    const auto started = b.u.empty() ? nullptr : with_start(variables_, b.u);
    b.fitted = adapt(b.observation, message_name(b), started ? *started : variables_, options,
                     adaptation, hooks);
    b.take_over();
  }

  BodiesInference finish() {
    BodiesInference result;
    result.group = group_;
    result.state_files = state_files_;
    for (std::size_t k = 0; k < bodies_.size(); ++k) {
      FitOptions options = options_;
      options.companions = companions_of(k);
      result.bodies.push_back(
          conclude(bodies_[k].fitted, message_name(bodies_[k]), variables_, options, adaptation_));
      result.rounds.push_back(bodies_[k].rounds);
    }
    return result;
  }

  const std::string& name_;
  const FitVariables& variables_;
  const FitOptions& options_;
  const FitHooks& hooks_;
  const AdaptationOptions& adaptation_;
  kernels::GridSettings grid_;
  std::vector<int> middle_;  ///< starts
  std::vector<Body> bodies_;
  std::vector<int> group_;
  std::vector<std::filesystem::path> state_files_;
};

}  // namespace

BodiesInference infer_bodies(const std::vector<ObservedBody>& bodies, const std::string& name,
                             const FitVariables& variables, const FitOptions& options,
                             const FitHooks& hooks, const AdaptationOptions& adaptation) {
  return BodiesFit(bodies, name, variables, options, hooks, adaptation).run();
}

}  // namespace uniphy
