#include "uniphy/inference/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <set>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/for_each.hpp"
#include "uniphy/inference/candidate_fit.hpp"
#include "uniphy/inference/fit_problem.hpp"
#include "uniphy/inference/levenberg_marquardt.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The schedule: which candidates are improved at which horizon, in steps that can be saved.
class Fit {
 public:
  Fit(const FitProblem& problem, const std::string& name, const FitOptions& options,
      const FitHooks& hooks)
      : problem_(problem),
        name_(name),
        variables_(problem.variables()),
        options_(options),
        hooks_(hooks) {}

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
  int stages() const { return problem_.stages(); }

  std::int64_t total_work() const {
    std::int64_t total = variables_.starts();
    for (const FitStage& s : options_.stages) total += std::int64_t(s.candidates) * most_work(s);
    return total;
  }

  /// Roll-outs of a candidate in a stage, at most.
  std::int64_t most_work(const FitStage& stage) const {
    if (stage.optimizer != kLevenbergMarquardt) return stage.epochs;
    return std::int64_t(stage.epochs) *
           (variables_.size() + problem_.motion_size() + LevenbergMarquardt::kTrialEvaluations);
  }

  /// Saves where it is time to, tells the user, and stops where the user asked for it.
  void checkpoint(std::int64_t work, bool now) {
    const auto clock = std::chrono::steady_clock::now();
    const bool due = std::chrono::duration<double>(clock - saved_).count() >= hooks_.save_seconds;
    if (!hooks_.state_file.empty() && (now || due || interrupt_requested())) {
      keep_optimizers();
      write_fit_state(hooks_.state_file, state_, hooks_.fingerprint);
      saved_ = clock;
    }
    show_progress(work);
  }

  void show_progress(std::int64_t work) {
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

  FitCandidate start_candidate(int start, int stage) const {
    FitCandidate c = problem_.candidate(start);
    c.mse = start_mse(start, stage);
    c.loss = problem_.loss(c.mse, c.u);
    return c;
  }

  double start_mse(int start, int stage) const {
    return state_.start_mse[start * stages() + stage];
  }

  /// All starts up to the first horizon, and over all frames those that may be chosen by that.
  void rank() {
    const int starts = variables_.starts();
    std::vector<double> table(starts * stages(), kNotRolledOut);
    std::vector<int> all(starts);
    std::iota(all.begin(), all.end(), 0);
    roll_out(all, problem_.frames(0), table);
    if (problem_.frames(0) < problem_.frames())
      roll_out(starts_ahead(table), problem_.frames(), table);
    state_.start_mse = std::move(table);
    std::vector<double> early(starts), full(starts);
    for (int i = 0; i < starts; ++i) {
      early[i] = start_mse(i, 0);
      full[i] = start_mse(i, stages() - 1);
    }
    for (const int i : choose_starts(variables_, early, full, options_.stages[0].candidates)) {
      state_.candidates.push_back(start_candidate(i, 0));
    }
    if (state_.candidates.empty()) problem_.refuse_starts();
    state_.stage = 0;
    checkpoint(0, true);
  }

  /// The losses of starts at the horizons up to `frames`, into [starts, stages].
  void roll_out(const std::vector<int>& which, std::ptrdiff_t frames, std::vector<double>& table) {
    constexpr std::size_t kBlock = 32;  // between two looks at the clock
    for (std::size_t first = 0; first < which.size(); first += kBlock) {
      const auto count = static_cast<int>(std::min(kBlock, which.size() - first));
      kernels::for_each(count, [&](int k) {
        const int i = which[first + k];
        const auto mse = problem_.frame_mse(problem_.candidate(i), frames);
        for (int s = 0; s < stages(); ++s) {
          double& entry = table[i * stages() + s];
          if (problem_.frames(s) <= frames)
            entry = mean_of_first(mse, problem_.frames(s));
          else if (!std::isfinite(mse.back()))
            entry = kInfinity;  // what failed fails later on
        }
      });
      show_progress(frames == problem_.frames(0) ? count : 0);
    }
  }

  /// An eighth of the starts, or what the first stage takes twice, and the best of each material.
  std::vector<int> starts_ahead(const std::vector<double>& table) const {
    std::vector<int> order;
    for (int i = 0; i < variables_.starts(); ++i) {
      if (std::isfinite(table[i * stages()])) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return table[a * stages()] < table[b * stages()]; });
    const auto most = std::max<std::size_t>(order.size() / 8, 2 * options_.stages[0].candidates);
    std::set<std::string> seen;
    std::vector<int> ahead;
    for (const int i : order) {
      if (seen.insert(variables_.label(i)).second || ahead.size() < most) ahead.push_back(i);
    }
    return ahead;
  }

  void make_fits() {
    const bool same_leaves = state_.stage > 0 && problem_.with_velocity(state_.stage) ==
                                                     problem_.with_velocity(state_.stage - 1);
    for (const FitCandidate& c : state_.candidates) {
      fits_.push_back(make_candidate_fit(problem_, c, state_.stage, options_));
      if (state_.steps > 0) {
        resume(*fits_.back(), c.optimizer);
      } else if (same_leaves) {
        fits_.back()->inherit(c.optimizer);
      }
    }
  }

  void resume(CandidateFit& fit, const std::string& bytes) const {
    try {
      fit.load(bytes);
    } catch (const Error& error) {
      throw Error(fmt::format("{}: {}", hooks_.state_file.string(), error.what()));
    }
  }

  /// The state of the optimizers, for the file and for the next stage.
  void keep_optimizers() {
    for (std::size_t i = 0; i < fits_.size(); ++i) {
      state_.candidates[i].optimizer = fits_[i]->save();
    }
  }

  void improve() {
    const std::int64_t most = most_work(options_.stages[state_.stage]);
    const int count = static_cast<int>(state_.candidates.size());
    const std::int64_t work_before = done_;
    make_fits();
    while (true) {
      std::vector<int> active;
      for (int i = 0; i < count; ++i) {
        if (!fits_[i]->done()) active.push_back(i);
      }
      if (active.empty()) break;
      std::vector<std::vector<FitRecord>> records(active.size());
      kernels::for_each(static_cast<int>(active.size()), [&](int k) {
        records[k] = step(state_.candidates[active[k]], *fits_[active[k]]);
      });
      ++state_.steps;
      std::int64_t work = 0;
      for (const auto& of_candidate : records) {
        work += static_cast<std::int64_t>(of_candidate.size());
        state_.history.insert(state_.history.end(), of_candidate.begin(), of_candidate.end());
        if (!hooks_.on_record) continue;
        for (const FitRecord& record : of_candidate) hooks_.on_record(record);
      }
      checkpoint(work, false);
    }
    keep_optimizers();
    fits_.clear();
    done_ = work_before + count * most;  // what stopped early counts as done
  }

  /// One step of a candidate's optimizer; keeps the best point in `best`.
  std::vector<FitRecord> step(FitCandidate& best, CandidateFit& fit) const {
    std::vector<FitRecord> records;
    const int before = fit.roll_outs();
    fit.step(best, [&](double mse) {
      records.push_back({state_.stage, best.start, before + static_cast<int>(records.size()),
                         problem_.horizon_time(state_.stage), mse});
    });
    return records;
  }

  /// Keeps the best at the next horizon.
  void next_stage() {
    const int next = state_.stage + 1;
    state_.steps = 0;
    if (next < stages() && problem_.frames(next) != problem_.frames(state_.stage)) {
      kernels::for_each(static_cast<int>(state_.candidates.size()), [&](int i) {
        FitCandidate& c = state_.candidates[i];
        const std::ptrdiff_t frames = problem_.frames(next);
        c.mse = mean_of_first(problem_.frame_mse(c, frames), frames);
        c.loss = problem_.loss(c.mse, c.u);
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
        return seen.insert(variables_.label(c.start)).second;
      });
    }
    if (all.size() > room) all.resize(room);
  }

  /// The best start over all frames, in case that nothing improved on it.
  void add_best_start() {
    int best = 0;
    for (int i = 1; i < variables_.starts(); ++i) {
      if (start_mse(i, stages() - 1) < start_mse(best, stages() - 1)) best = i;
    }
    FitCandidate candidate = start_candidate(best, stages() - 1);
    state_.candidates.push_back(std::move(candidate));
  }

  void check_state() const {
    const auto fail = [&](const std::string& what) {
      throw Error(fmt::format("{}: {}", hooks_.state_file.string(), what));
    };
    if (state_.stage < 0 || state_.stage > stages()) fail("stage out of range");
    if (state_.start_mse.size() != static_cast<std::size_t>(variables_.starts() * stages())) {
      fail("expected one loss a start and stage");
    }
    if (state_.candidates.empty()) fail("expected candidates, found none");
    for (const FitCandidate& c : state_.candidates) {
      if (c.start < 0 || c.start >= variables_.starts() || c.u.numel() != variables_.size() ||
          c.motion.numel() != problem_.motion_size()) {
        fail("a candidate does not fit the model");
      }
    }
  }

  FitResult result() const {
    const FitCandidate& best = state_.candidates.front();
    FitResult r;
    r.u.assign(best.u.data_ptr<double>(), best.u.data_ptr<double>() + best.u.numel());
    r.motion = problem_.motion(best);
    r.mse = best.mse;
    r.start = best.start;
    for (const FitCandidate& c : state_.candidates) {
      if (!std::isfinite(c.mse)) break;
      FitEnd end{c.start, {}, problem_.motion(c)};
      end.u.assign(c.u.data_ptr<double>(), c.u.data_ptr<double>() + c.u.numel());
      r.ends.push_back(std::move(end));
    }
    r.history = state_.history;
    r.stages = stages();
    r.contact = problem_.contact();
    r.determined = r.contact < problem_.frames();
    for (int i = 0; i < variables_.starts(); ++i) {
      r.start_mse.push_back(start_mse(i, stages() - 1));
    }
    if (!std::isfinite(best.mse)) {
      throw Error(fmt::format("{}: no candidate can be simulated over all {} frames", name_,
                              problem_.frames()));
    }
    r.law = variables_.law(r.u);
    return r;
  }

  const FitProblem& problem_;
  const std::string& name_;
  const FitVariables& variables_;
  const FitOptions& options_;
  const FitHooks& hooks_;
  FitState state_;
  std::vector<std::unique_ptr<CandidateFit>> fits_;  ///< of the candidates, while in a stage
  std::optional<Progress> progress_;
  std::int64_t done_ = 0;
  std::chrono::steady_clock::time_point saved_ = std::chrono::steady_clock::now();
};

}  // namespace

FitResult fit_observation(const Observation& observation, const std::string& name,
                          const FitVariables& variables, const FitOptions& options,
                          const FitHooks& hooks) {
  const FitProblem problem(observation, name, variables, options);
  return Fit(problem, name, options, hooks).run();
}

}  // namespace uniphy
