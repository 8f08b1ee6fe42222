#include "uniphy/inference/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <set>

#include "ops/kernels/error.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Units in which the initial velocity is refined, beside u which is of order one.
constexpr double kLinearUnit = 0.1;   // m/s
constexpr double kAngularUnit = 0.5;  // rad/s

/// visit(i) for every i < count on all threads; roll-outs inside then use one thread each.
template <class Visit>
void side_by_side(int count, const Visit& visit) {
  if (count == 1) {  // the roll-out itself uses the threads
    visit(0);
    return;
  }
  std::exception_ptr failure;
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < count; ++i) {
    try {
      visit(i);
    } catch (...) {
#pragma omp critical(uniphy_fit_failure)
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

class Fit {
 public:
  Fit(const Observation& observation, const std::string& name, const Unknowns& unknowns,
      const FitOptions& options, const FitHooks& hooks)
      : observation_(observation),
        name_(name),
        unknowns_(unknowns),
        options_(options),
        hooks_(hooks),
        steps_(observed_steps(observation, name)),
        grid_(observed_grid(observation, name)),
        size_(observed_size(observation)),
        motion_(observed_motion(observation, steps_, grid_, options.velocity_frames)),
        contact_(first_contact(observation, steps_, grid_, motion_)),
        objective_(make_motion_objective(observation, steps_, grid_, options.dtype)) {
    if (options.stages.empty() || options.stages.back().horizon < 1) {
      throw Error("stages: expected a last stage with horizon 1");
    }
    kernels::make_law<double>(unknowns.law(unknowns.start(0)));  // a model that does not fit: now
  }

  FitResult run() {
    if (!hooks_.state_file.empty() && std::filesystem::exists(hooks_.state_file)) {
      state_ = read_fit_state(hooks_.state_file, hooks_.fingerprint);
      check_state();
    }
    if (hooks_.progress) progress_.emplace("fit", total_work(), "roll-outs");
    if (state_.stage < 0) rank();
    while (state_.stage < stages()) {
      improve();
      next_stage();
    }
    if (progress_) progress_->finish();
    return result();
  }

 private:
  int stages() const { return static_cast<int>(options_.stages.size()); }
  const FitStage& stage() const { return options_.stages[state_.stage]; }
  std::ptrdiff_t frames_of(int stage) const {
    return horizon_frames(options_.stages[stage].horizon, contact_, observation_.frames);
  }
  double horizon_time(int stage) const {
    return static_cast<double>(steps_.last(frames_of(stage))) * grid_.dt;
  }
  bool with_velocity() const { return options_.refine_velocity && state_.stage + 1 == stages(); }

  std::int64_t total_work() const {
    std::int64_t total = unknowns_.starts();
    for (const FitStage& s : options_.stages) total += std::int64_t(s.candidates) * s.epochs;
    return total;
  }

  double loss(double mse, const std::vector<double>& u) const {
    const double weight = options_.prior / (options_.prior_sigma * options_.prior_sigma);
    return mse / (size_ * size_) + (weight > 0 ? weight * unknowns_.prior(u, 0, nullptr) : 0);
  }

  /// Saves where it is time to, tells the user, and stops where the user asked for it.
  void checkpoint(std::int64_t work, bool now) {
    const auto clock = std::chrono::steady_clock::now();
    const bool due = std::chrono::duration<double>(clock - saved_).count() >= hooks_.save_seconds;
    if (!hooks_.state_file.empty() && (now || due || interrupt_requested())) {
      write_fit_state(hooks_.state_file, state_, hooks_.fingerprint);
      saved_ = clock;
    }
    done_ += work;
    if (progress_) progress_->update(done_, note());
    throw_if_interrupted();
  }

  std::string note() const {
    double best = kInfinity;
    for (const FitCandidate& c : state_.candidates) best = std::min(best, c.mse);
    if (state_.stage < 0) return "starts";
    return fmt::format("stage {} of {}, mse {:.2e} m^2", std::min(state_.stage + 1, stages()),
                       stages(), best);
  }

  void rank() {
    const int starts = unknowns_.starts();
    std::vector<double> table(starts * stages(), kInfinity);
    constexpr int kBlock = 32;  // between two looks at the clock
    for (int first = 0; first < starts; first += kBlock) {
      const int count = std::min(kBlock, starts - first);
      side_by_side(count, [&](int k) {
        const int i = first + k;
        const auto mse =
            objective_->frame_mse(unknowns_.law(unknowns_.start(i)), motion_, observation_.frames);
        for (int s = 0; s < stages(); ++s) {
          table[i * stages() + s] = mean_of_first(mse, frames_of(s));
        }
      });
      done_ += count;
      if (progress_) progress_->update(done_, note());
      throw_if_interrupted();
    }
    state_.start_mse = std::move(table);
    std::vector<double> early(starts), full(starts);
    for (int i = 0; i < starts; ++i) {
      early[i] = start_mse(i, 0);
      full[i] = start_mse(i, stages() - 1);
    }
    for (const int i : choose_starts(unknowns_, early, full, options_.stages[0].candidates)) {
      const std::vector<double> u = unknowns_.start(i);
      FitCandidate candidate = candidate_at(i, u);
      candidate.mse = early[i];
      candidate.loss = loss(early[i], u);
      state_.candidates.push_back(std::move(candidate));
    }
    if (state_.candidates.empty()) refuse_starts();
    state_.stage = 0;
    checkpoint(0, true);
  }

  double start_mse(int start, int stage) const {
    return state_.start_mse[start * stages() + stage];
  }

  [[noreturn]] void refuse_starts() const {
    std::string reason = "the positions are not finite";
    try {
      objective_->simulate(unknowns_.law(unknowns_.start(0)), motion_,
                           [](std::ptrdiff_t, const std::vector<double>&) {});
    } catch (const Error& error) {
      reason = error.what();
    }
    throw Error(fmt::format(
        "{}: expected that at least one of {} starts can be simulated for {} s, found none; the "
        "first: {}",
        name_, unknowns_.starts(), horizon_time(0), reason));
  }

  FitCandidate candidate_at(int start, const std::vector<double>& u) const {
    FitCandidate c;
    c.start = start;
    c.u = u;
    c.motion = motion_;
    return c;
  }

  /// u, and the initial velocity where it is fitted too.
  std::vector<double> pack(const FitCandidate& c) const {
    std::vector<double> w = c.u;
    if (!with_velocity()) return w;
    const Eigen::Vector3d linear = (c.motion.linear - motion_.linear) / kLinearUnit;
    const Eigen::Vector3d angular = (c.motion.angular - motion_.angular) / kAngularUnit;
    w.insert(w.end(), linear.data(), linear.data() + 3);
    w.insert(w.end(), angular.data(), angular.data() + 3);
    return w;
  }
  FitCandidate unpack(int start, const std::vector<double>& w) const {
    FitCandidate c = candidate_at(start, w);
    if (!with_velocity()) return c;
    const double* extra = w.data() + unknowns_.size();
    c.u.resize(unknowns_.size());
    c.motion.linear += kLinearUnit * Eigen::Map<const Eigen::Vector3d>(extra);
    c.motion.angular += kAngularUnit * Eigen::Map<const Eigen::Vector3d>(extra + 3);
    return c;
  }

  /// Loss and gradient at `c`; fills in its mse and loss.
  std::vector<double> evaluate(FitCandidate& c, std::ptrdiff_t frames) const {
    const Evaluation e = objective_->evaluate(unknowns_.law(c.u), c.motion, frames);
    c.mse = e.mse;
    c.loss = std::isfinite(e.mse) ? loss(e.mse, c.u) : kInfinity;
    if (!std::isfinite(c.loss)) return {};
    std::vector<double> g = unknowns_.gradient(c.u, e.parameters);
    const double unit = 1 / (size_ * size_);
    for (double& x : g) x *= unit;
    const double weight = options_.prior / (options_.prior_sigma * options_.prior_sigma);
    if (weight > 0) unknowns_.prior(c.u, weight, &g);
    if (with_velocity()) {
      for (int k = 0; k < 6; ++k) {
        g.push_back(unit * (k < 3 ? kLinearUnit : kAngularUnit) * e.motion[k]);
      }
    }
    return g;
  }

  bool going_on(const FitCandidate& c) const { return c.stalled < options_.patience; }

  void improve() {
    const FitStage& now = stage();
    const OptimizerOptions settings{now.optimizer, now.rate, now.epochs, options_.clip};
    const int count = static_cast<int>(state_.candidates.size());
    std::vector<std::unique_ptr<Optimizer>> optimizers;
    for (FitCandidate& c : state_.candidates) {
      optimizers.push_back(make_optimizer(settings, pack(c)));
      if (state_.epoch > 0) {
        optimizers.back()->unpack(c.optimizer);
      } else {
        optimizers.back()->inherit(c.optimizer);
        c.reference = kInfinity;
        c.stalled = 0;
      }
    }
    const std::ptrdiff_t frames = frames_of(state_.stage);
    const std::int64_t work_before = done_;
    while (state_.epoch < now.epochs) {
      std::vector<int> active;
      for (int i = 0; i < count; ++i) {
        if (going_on(state_.candidates[i])) active.push_back(i);
      }
      if (active.empty()) break;
      std::vector<FitRecord> records(active.size());
      side_by_side(static_cast<int>(active.size()), [&](int k) {
        FitCandidate& best = state_.candidates[active[k]];
        Optimizer& optimizer = *optimizers[active[k]];
        FitCandidate at = unpack(best.start, optimizer.ask());
        const std::vector<double> gradient = evaluate(at, frames);
        optimizer.tell(at.loss, gradient);
        records[k] = {state_.stage, best.start, state_.epoch, horizon_time(state_.stage), at.mse};
        take(best, at);
        best.optimizer = optimizer.pack();
      });
      ++state_.epoch;
      for (const FitRecord& record : records) {
        state_.history.push_back(record);
        if (hooks_.on_record) hooks_.on_record(record);
      }
      checkpoint(static_cast<std::int64_t>(active.size()), false);
    }
    done_ = work_before + std::int64_t(count) * now.epochs;  // what stopped early counts as done
  }

  /// Keeps the better of `best` and a new evaluation, and counts those that gained next to nothing.
  static void take(FitCandidate& best, const FitCandidate& at) {
    if (at.loss < best.loss) {
      best.u = at.u;
      best.motion = at.motion;
      best.loss = at.loss;
      best.mse = at.mse;
    }
    if (best.loss < 0.99 * best.reference) {
      best.reference = best.loss;
      best.stalled = 0;
    } else {
      ++best.stalled;
    }
  }

  /// Keeps the best at the next horizon.
  void next_stage() {
    const int next = state_.stage + 1;
    state_.epoch = 0;
    if (next < stages() && frames_of(next) != frames_of(state_.stage)) {
      side_by_side(static_cast<int>(state_.candidates.size()), [&](int i) {
        FitCandidate& c = state_.candidates[i];
        const auto mse = objective_->frame_mse(unknowns_.law(c.u), c.motion, frames_of(next));
        c.mse = mean_of_first(mse, frames_of(next));
        c.loss = loss(c.mse, c.u);
      });
    }
    if (next == stages()) add_best_start();
    std::stable_sort(state_.candidates.begin(), state_.candidates.end(),
                     [](const FitCandidate& a, const FitCandidate& b) { return a.loss < b.loss; });
    if (next < stages()) keep_candidates(next);
    state_.stage = next;
    checkpoint(0, true);
  }

  /// Before the last stage the best of each material stays, as long as there is room: one kind of
  /// material may explain the first moments better and the rest not at all.
  void keep_candidates(int next) {
    const auto room = static_cast<std::size_t>(options_.stages[next].candidates);
    std::vector<FitCandidate>& all = state_.candidates;  // sorted by loss
    if (next + 1 < stages()) {
      std::set<std::string> seen;
      std::stable_partition(all.begin(), all.end(), [&](const FitCandidate& c) {
        return seen.insert(unknowns_.label(c.start)).second;
      });
    }
    if (all.size() > room) all.resize(room);
  }

  /// The best start over all frames, in case that nothing improved on it.
  void add_best_start() {
    int best = 0;
    for (int i = 1; i < unknowns_.starts(); ++i) {
      if (start_mse(i, stages() - 1) < start_mse(best, stages() - 1)) best = i;
    }
    const double mse = start_mse(best, stages() - 1);
    const std::vector<double> u = unknowns_.start(best);
    FitCandidate candidate = candidate_at(best, u);
    candidate.mse = mse;
    candidate.loss = loss(mse, u);
    candidate.optimizer = state_.candidates.front().optimizer;  // rows of one length in the file
    state_.candidates.push_back(std::move(candidate));
  }

  void check_state() const {
    const auto fail = [&](const std::string& what) {
      throw Error(fmt::format("{}: {}", hooks_.state_file.string(), what));
    };
    if (state_.stage < 0 || state_.stage > stages()) fail("stage out of range");
    if (state_.start_mse.size() != static_cast<std::size_t>(unknowns_.starts() * stages())) {
      fail("expected one loss a start and stage");
    }
    if (state_.candidates.empty()) fail("expected candidates, found none");
    for (const FitCandidate& c : state_.candidates) {
      if (c.start < 0 || c.start >= unknowns_.starts() ||
          static_cast<int>(c.u.size()) != unknowns_.size()) {
        fail("a candidate does not fit the model");
      }
    }
  }

  FitResult result() const {
    const FitCandidate& best = state_.candidates.front();
    FitResult r;
    r.u = best.u;
    r.motion = best.motion;
    r.mse = best.mse;
    r.start = best.start;
    r.history = state_.history;
    r.contact = contact_;
    for (int i = 0; i < unknowns_.starts(); ++i) {
      r.start_mse.push_back(start_mse(i, stages() - 1));
    }
    if (!std::isfinite(best.mse)) {
      throw Error(fmt::format("{}: no candidate can be simulated over all {} frames", name_,
                              observation_.frames));
    }
    r.law = unknowns_.law(r.u);
    return r;
  }

  const Observation& observation_;
  std::string name_;
  const Unknowns& unknowns_;
  FitOptions options_;
  const FitHooks& hooks_;
  ObservedSteps steps_;
  kernels::GridSettings grid_;
  double size_;
  RigidMotion motion_;
  std::ptrdiff_t contact_;
  std::unique_ptr<const MotionObjective> objective_;
  FitState state_;
  std::optional<Progress> progress_;
  std::int64_t done_ = 0;
  std::chrono::steady_clock::time_point saved_ = std::chrono::steady_clock::now();
};

}  // namespace

FitResult fit_observation(const Observation& observation, const std::string& name,
                          const Unknowns& unknowns, const FitOptions& options,
                          const FitHooks& hooks) {
  return Fit(observation, name, unknowns, options, hooks).run();
}

}  // namespace uniphy
