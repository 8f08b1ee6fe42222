#pragma once

#include <torch/types.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "uniphy/inference/adaptation.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/inference/rung_fit.hpp"

namespace uniphy {

/// What least squares do with the initial velocity: leave it, fit it with what the first frames
/// know of it by their noise, or hold it to that, too, as far as more than noise is missed. The
/// last is for a law that is as near as it comes: of one on its way it would hold a velocity that
/// is off.
enum class FitVelocity { no, yes, held };

/// How strongly least squares over the first `frames` pull the initial state to the one of the
/// first frames, [FitProblem::motion_size()]: what that is known to against what a roll-out misses.
/// Noise is independent from point to point; `beside` (over size, squared) is what the law, the
/// grid or the time step leave beside it, one error that all share, so that such a misfit does not
/// move a velocity that is held.
torch::Tensor motion_pull(const FitProblem& problem, const MotionEstimate& first,
                          std::ptrdiff_t frames, double beside);
/// Of a loss, what noise does not account for; `starts`: those of the points are eliminated.
double misfit_beside_noise(const FitProblem& problem, double loss, bool starts);

/// The work of a ladder: fits points of its rungs to an observation or its first part, shows the
/// progress, keeps the state on disk and counts what each rung cost.
class RungFitter {
 public:
  /// Keeps references to the arguments.
  RungFitter(const Observation& observation, const std::string& name, const FitVariables& latent,
             const FitOptions& options, const AdaptationOptions& adaptation, const FitHooks& hooks);

  /// Of a learned law.
  const AdaptedVariables& variables(Rung rung) const { return *adapted_[int(rung)]; }
  double size() const { return size_; }
  AdaptationState& state() { return state_; }
  /// The initial velocity of all roll-outs from now on.
  void set_motion(const InitialState& motion) { motion_ = motion; }
  const InitialState& motion() const { return motion_; }
  /// How clouds are compared from now on.
  void set_detail(CloudDetail detail) { detail_ = detail; }
  /// Where least squares on the first `frames` of `seen`, the observation or its first part, end,
  /// pulled to `to` by `pull`; where asked for, with the initial velocity, which then is that of
  /// all roll-outs. `task` is unique within the rung; for `least_gain` see uniphy::least_squares.
  LeastSquaresEnd least_squares(const Observation& seen, std::ptrdiff_t frames, Rung rung,
                                const torch::Tensor& start, const torch::Tensor& to, double pull,
                                const std::string& task, int iterations, FitVelocity velocity,
                                double least_gain = 0);
  /// δ [points, 3] of the starts of `seen` by the law at a point (StartCorrection::correction).
  torch::Tensor start_shift(const Observation& seen, Rung rung, const torch::Tensor& point) const;
  /// The same of all weights, by at most `epochs` roll-outs with gradients over all frames.
  torch::Tensor descend(const Observation& seen, const torch::Tensor& start,
                        const std::string& task, int epochs);
  /// What `seen` says about z and the law's own numbers at a point, with the initial velocity.
  FitPosterior posterior(const Observation& seen, Rung rung, const torch::Tensor& point);
  /// Root of the mean square error over size of each of the first frames; infinite from where the
  /// roll-out fails.
  std::vector<double> roots(const torch::Tensor& point, Rung rung, std::ptrdiff_t frames) const;

  /// Whether the law of a point can be simulated for as long again as it was observed: one that
  /// was adapted to a motion may fail right after it.
  bool lasts(const torch::Tensor& point, Rung rung) const;

  /// The report of a rung, which is added where there is none.
  RungReport& report(Rung rung);
  const std::vector<RungReport>& reports() const { return reports_; }

 private:
  FitOptions rung_options(bool differences) const;
  const FitVariables& of(Rung rung) const;
  /// motion_pull of a problem at a point.
  torch::Tensor pull_of_motion(const FitProblem& problem, const torch::Tensor& point,
                               std::ptrdiff_t frames, bool held) const;
  /// Where the points start, by the flow at a point; nothing where that is known or the roll-out
  /// fails.
  std::optional<StartCorrection> starts_at(const FitProblem& problem, const torch::Tensor& point,
                                           std::ptrdiff_t frames) const;
  template <class Improve>
  auto work(Rung rung, const std::string& name, int steps, const Improve& improve);

  const Observation& observation_;
  const std::string& name_;
  const FitVariables& latent_;
  const FitOptions& options_;
  const AdaptationOptions& adaptation_;
  const FitHooks& hooks_;
  AdaptationState state_;
  double size_;
  MotionEstimate first_motion_;  ///< from the first frames alone
  InitialState motion_;
  CloudDetail detail_ = CloudDetail::all;
  std::vector<std::unique_ptr<AdaptedVariables>> adapted_;  ///< of each rung; empty: analytic
  std::vector<RungReport> reports_;
};

}  // namespace uniphy
