#pragma once

#include "ops/loss/law_losses.hpp"
#include "uniphy/config/config.hpp"

namespace uniphy {

/// How a training and a fit of codes weigh the errors of the law (LawErrors) and the codes.
struct LossOptions {
  double latent_sigma = 10;    ///< σ of the prior ‖z‖²/σ²
  double prior_weight = 1e-2;  ///< of the prior beside the errors of a trajectory
  double error_floor = 0.1;
  double delta = 1e-3;   ///< δ of log(1 + error/δ)
  bool squared = false;  ///< published form: squared errors over the trajectory's mean square

  ops::ErrorMeasure measure() const { return {error_floor, delta}; }
};

/// Declares and reads one key for each; the defaults are what `options` holds.
void read_loss_options(Section& config, LossOptions& options);

}  // namespace uniphy
