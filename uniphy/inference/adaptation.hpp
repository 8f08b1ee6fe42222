#pragma once

#include <string>
#include <vector>

#include "uniphy/inference/adapted_variables.hpp"
#include "uniphy/inference/fit.hpp"
#include "uniphy/inference/fit_posterior.hpp"
#include "uniphy/inference/rung_report.hpp"

namespace uniphy {

struct AdaptationOptions {
  std::vector<Rung> rungs{Rung::latent, Rung::numbers, Rung::weights};  ///< upwards, latent first
  /// Share of the time from first contact to the last frame that is kept from the fits: the frames
  /// at the end, which decide between the rungs.
  double kept = 0.25;
  double gain = 0.2;     ///< share of the error there that a rung has to take away to pay
  double enough = 3e-4;  ///< root of the mean square error over size that asks for no more
  double pull = 1e-8;    ///< weight of ‖W − W₀‖² on the last rung, against mse/size²
  /// Root of the mean square error over size, beside the noise, of a motion that counts as
  /// explained. A choice, tried on the benchmark cube alone; so are `gain`, `enough` and `pull`.
  double tolerance = 1e-3;
  int iterations = 12;              ///< of LevenbergMarquardt, at most
  int epochs = 60;                  ///< roll-outs with gradients of all weights
  std::string optimizer = "lbfgs";  ///< of all weights, see DescentOptions
  double rate = 0.01;               ///< likewise
  int samples = 64;                 ///< of the posterior (FitPosterior), a multiple of 8; 0: none
};

struct Adaptation {
  FitResult fit;  ///< of the rung chosen; its u is that of the latent variables
  Rung rung = Rung::latent;
  std::vector<RungReport> rungs;  ///< those that were tried; empty where nothing was kept
  int roll_outs = 0;              ///< of all that was tried, with gradients or without
  /// What was observed with the starts of its points where they were found to be, see
  /// StartCorrection.
  Observation seen;
  bool starts_fitted = false;
  /// Of the rung chosen; of all weights only z and the law's own numbers count as unknown. Empty
  /// without a contact, and where no samples are asked for.
  FitPosterior posterior;
  std::vector<kernels::LawDescription> samples;  ///< the laws of posterior.samples
};

/// Finds the law of an observation with as much freedom as its motion asks for: z; then also the
/// law's own numbers, the biases of the last layers; then all weights, pulled towards the trained
/// ones.
///
/// 1. Every rung is fitted to the first part of the observation, from the best point of the rung
///    before: z as in fit_observation, then it and the numbers by LevenbergMarquardt, the weights
///    by Descent.
/// 2. The frames that were kept decide. The ladder ends where a rung explains both parts to
///    `enough` and the noise, or where the next one does not take away `gain` of the error on the
///    kept part, or cannot be simulated for as long again; then the one before is the result.
/// 3. Not only the fitted z goes up to `numbers`: the best start of every other material does too,
///    since the nearest code of the trained family may be of the wrong kind, and points at which
///    the two terms of the elastic stress are apart (split_terms). They are fitted over horizons
///    that grow as in the schedule, and half of them, those that forecast best up to the next one,
///    go on. All are pulled to where they began, less and less, until no more than the noise says.
/// 4. The rung chosen is fitted to the whole observation, from where it is.
/// 5. What the observation says about the numbers of that rung: fit_posterior.
///
/// With z the initial velocity is fitted by LevenbergMarquardt. Where the points are tracers or
/// noisy, where they start is, too (StartCorrection): eliminated by the flow at every iteration and
/// moved after a fit, until that settles. Noise-free observations of particles start where they are
/// seen. What gradients see of noisy starts is an error of the law, the more the longer the
/// roll-out: there they end before the last stage, and least squares go on from several of their
/// ends, over the horizons of the schedule, of which each leaves the better half. The velocity then
/// is known to what the noise of the first frames leaves of it, and is held to them only where the
/// best law misses more than noise (best_end, FitVelocity).
///
/// Where the body is deformed at the first frame (Observation::start_degree), its velocity and
/// stretch there are fitted with z from the best starts of each material, which race in the same
/// way; the law is not adapted then, since what is left is of the polynomials. Of clouds without
/// correspondence it is the same, with the velocity alone; the race compares a part of their points
/// (CloudDetail::rough).
///
/// Analytic variables have no rung but `latent`; where that is the only one, all frames are fitted.
/// Without a contact it is fit_observation alone. Resumes like it, with adaptation_state_file()
/// beside its state file. Results have the same bits on any number of threads. hooks.on_record is
/// called after every step above z too, with a stage beyond those of the schedule and infinite
/// horizon.
Adaptation adapt(const Observation& observation, const std::string& name,
                 const FitVariables& variables, const FitOptions& options,
                 const AdaptationOptions& adaptation, const FitHooks& hooks = {});

}  // namespace uniphy
