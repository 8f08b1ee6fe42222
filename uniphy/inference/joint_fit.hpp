#pragma once

#include <torch/types.h>

#include <limits>
#include <string>
#include <vector>

#include "uniphy/inference/adaptation.hpp"
#include "uniphy/inference/adaptation_state.hpp"

namespace uniphy {

/// A body of several that move each other, with what is fitted of it.
struct JointBody {
  std::string name;  ///< for messages
  Observation seen;  ///< the starts of its points move with the fit
  torch::Tensor u;   ///< [size] of the variables
  InitialState motion;
  /// mse over size², of the end; infinite where the roll-out fails from the start on.
  double loss = std::numeric_limits<double>::infinity();
  double enough = 0;         ///< over size, of a motion that counts as explained
  bool fits_starts = false;  ///< FitProblem::fits_starts
  /// Of its own numbers, those of the other bodies integrated out, see JointFit::add_posterior.
  FitPosterior posterior;

  bool explained() const;
};

/// Least squares on the codes and the initial states of all bodies at once, each compared with its
/// own points in a roll-out in which all move: block by block, one body's error is what the others'
/// leave, and a descent over blocks creeps.
class JointFit {
 public:
  /// Keeps references to all but the bodies. `options` are those of the fits; float64 is used.
  JointFit(std::vector<JointBody> bodies, const FitVariables& variables, const FitOptions& options,
           const AdaptationOptions& adaptation, const FitHooks& hooks);

  /// Moves the bodies to where at most AdaptationOptions::iterations of LevenbergMarquardt lead;
  /// where starts are fitted, in rounds between which they are moved. Goes on from the state file
  /// of the hooks.
  void run();
  /// Samples of the posterior of all numbers (fit_posterior) into that of each body.
  void add_posterior();

  const std::vector<JointBody>& bodies() const { return bodies_; }
  int roll_outs() const { return roll_outs_; }
  const std::filesystem::path& state_file() const { return state_.file(); }

 private:
  class Problem;

  FitOptions options_;
  const FitVariables& variables_;
  const AdaptationOptions& adaptation_;
  const FitHooks& hooks_;
  std::vector<JointBody> bodies_;
  AdaptationState state_;
  int roll_outs_ = 0;
};

/// What a posterior says of the `size` numbers from `first` on, and of the `motion` numbers from
/// `motion_first` on, of its points.
FitPosterior marginal_of(const FitPosterior& posterior, std::int64_t first, std::int64_t size,
                         std::int64_t motion_first, std::int64_t motion);

}  // namespace uniphy
