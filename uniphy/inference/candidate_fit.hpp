#pragma once

#include <functional>
#include <memory>
#include <string>

#include "uniphy/inference/fit_problem.hpp"

namespace uniphy {

/// How a stage of a fit improves one candidate: an optimizer of Torch, a step at a time.
class CandidateFit {
 public:
  virtual ~CandidateFit() = default;
  /// Whether the budget or the patience is used up, or there is nowhere left to go.
  virtual bool done() const = 0;
  /// One step, which moves the candidate where it finds a lower loss; on_roll_out(mse) is called
  /// for every roll-out with the error of the best point known then (lbfgs, adamw: of its own).
  virtual void step(FitCandidate& best, const std::function<void(double)>& on_roll_out) = 0;
  virtual int roll_outs() const = 0;
  /// Everything that the next steps depend on; load() goes on to the same bits. Throws Error where
  /// the bytes are damaged or belong to a candidate of another size.
  virtual std::string save() const = 0;
  virtual void load(const std::string& bytes) = 0;
  /// Takes over what the save() of the stage before has found of the curvature.
  virtual void inherit(const std::string& bytes) = 0;
};

/// `lbfgs` and `adamw` follow the gradient (Descent), `levenberg_marquardt` the Jacobian by
/// differences. The latter is pulled to where the candidate begins (Pull) by kFirstPull, and by
/// kPullOfHorizons of that with each stage: a short horizon hardly shows some directions of z, and
/// along them a fit runs off to where the next horizon cannot bring it back. In the last stage,
/// where it has settled, the pull falls to kPullOfFits of itself until the noise alone would pull
/// as much (FitProblem::least_pull). Keeps a reference to the problem.
std::unique_ptr<CandidateFit> make_candidate_fit(const FitProblem& problem,
                                                 const FitCandidate& from, int stage,
                                                 const FitOptions& options);

/// Of positions over size, as the weight of Pull. Without it the jelly cube ended at 1e-3 of the
/// size for 3e-5 with it, when the law's own numbers were fitted.
inline constexpr double kFirstPull = 1e-3, kPullOfHorizons = 0.3, kPullOfFits = 0.1;

}  // namespace uniphy
