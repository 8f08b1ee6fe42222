#pragma once

#include <torch/types.h>

#include <memory>
#include <string>
#include <vector>

#include "uniphy/inference/adaptation.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/rung_fit.hpp"

namespace uniphy {

/// The work of a ladder: fits points of its rungs to an observation or its first part, shows the
/// progress, keeps the state on disk and counts what each rung cost.
class RungFitter {
 public:
  /// Keeps references to the arguments.
  RungFitter(const Observation& observation, const std::string& name, const FitVariables& latent,
             const FitOptions& options, const AdaptationOptions& adaptation, const FitHooks& hooks);

  const AdaptedVariables& variables(Rung rung) const { return *variables_[int(rung)]; }
  double size() const { return size_; }
  AdaptationState& state() { return state_; }
  /// The initial velocity of all roll-outs from now on.
  void set_motion(const RigidMotion& motion) { motion_ = motion; }

  /// The point that least squares on the first `frames` of `seen`, the observation or its first
  /// part, lead to. `task` is unique within the rung.
  torch::Tensor least_squares(const Observation& seen, std::ptrdiff_t frames, Rung rung,
                              const torch::Tensor& start, const Pull& pull, const std::string& task,
                              int iterations);
  /// The same of all weights, by at most `epochs` roll-outs with gradients over all frames.
  torch::Tensor descend(const Observation& seen, const torch::Tensor& start,
                        const std::string& task, int epochs);
  /// Root of the mean square error over size of each of the first frames; infinite from where the
  /// roll-out fails.
  std::vector<double> roots(const torch::Tensor& point, Rung rung, std::ptrdiff_t frames) const;

  /// The report of a rung, which is added where there is none.
  RungReport& report(Rung rung);
  const std::vector<RungReport>& reports() const { return reports_; }

 private:
  FitOptions rung_options(bool differences) const;
  template <class Improve>
  torch::Tensor work(Rung rung, const std::string& name, int steps, const Improve& improve);

  const Observation& observation_;
  const std::string& name_;
  const FitOptions& options_;
  const AdaptationOptions& adaptation_;
  const FitHooks& hooks_;
  AdaptationState state_;
  double size_;
  RigidMotion motion_;
  std::vector<std::unique_ptr<AdaptedVariables>> variables_;  ///< of each rung
  std::vector<RungReport> reports_;
};

}  // namespace uniphy
