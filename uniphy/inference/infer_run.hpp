#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "uniphy/inference/adaptation.hpp"
#include "uniphy/inference/infer_options.hpp"
#include "uniphy/inference/material_belief.hpp"
#include "uniphy/inference/misfit.hpp"
#include "uniphy/inference/observation_check.hpp"
#include "uniphy/io/trajectory.hpp"
#include "uniphy/report/metrics.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/report/report.hpp"

namespace uniphy {

/// A finished inference and the roll-out of its result.
struct Inference {
  FitResult fit;
  Observation seen;   ///< with the starts of its points as fitted, see Adaptation
  Trajectory fitted;  ///< the points at the observed frames
  /// [frames, particles, 3, 3], the deformation gradients of `fitted`; empty where the material is
  /// not determined or the points are no particles.
  std::vector<double> deformation;
  double fit_mse = 0;             ///< m², of `fitted` against the observation
  double size = 0;                ///< m, largest side of the observed body
  double best_start = 0;          ///< m², what the best start reaches over all frames
  ObservationCheck check;         ///< whether the observation is what the fit takes it for
  int roll_outs = 0;              ///< of all that was tried, with gradients or without
  Rung rung = Rung::latent;       ///< how far the law was adapted
  std::vector<RungReport> rungs;  ///< see Adaptation
  Misfit misfit;                  ///< of `fitted`
  MaterialBelief material;        ///< of the fitted law; empty where it is not determined
  FitPosterior posterior;         ///< see Adaptation
  bool explained = true;  ///< whether noise and tolerance account for the misfit, see explains()
};

/// Fits and rolls out once more; z alone unless `adaptation` says otherwise. Points that are first
/// seen after the contact are left out (with_known_starts). Throws Error.
Inference infer(const Observation& observation, const std::string& name,
                const FitVariables& variables, const FitOptions& options, const FitHooks& hooks,
                const AdaptationOptions& adaptation = {{Rung::latent}});
/// What infer() makes of a finished fit: rolls it out and reads it.
Inference conclude(const Adaptation& adapted, const std::string& name,
                   const FitVariables& variables, const FitOptions& options,
                   const AdaptationOptions& adaptation);

/// Whether noise and tolerance account for the misfit of all frames, and, where frames were kept,
/// for the error there of the rung chosen before it saw them (Misfit::allowed_ahead).
bool explains(const Inference& inference);

/// The product of uniphy_infer. `model` is the path that resimulate will look for. Names no
/// nearest codes where the material is not determined.
LatentFile latent_of(const Inference& inference, const Observation& observation,
                     const FitVariables& variables, const std::string& model,
                     const std::string& config);

/// The adapted law as a model, with the fitted code as its only one.
ModelFile adapted_model(const Inference& inference, const Observation& observation,
                        const std::string& config);

/// Roll-outs with gradients, of all candidates, until the mse over all frames was a hundredth of
/// the best start's: what optimizers are compared by. Nothing where that was never reached.
std::optional<std::size_t> roll_outs_to_a_hundredth(const FitResult& fit);

/// fit_mse (m²), fit_root_over_size, size, best_start_mse, roll_outs (those with gradients, of the
/// schedule), roll_outs.all (Inference::roll_outs), roll_outs_to_a_hundredth
/// (where it was reached), starts, starts_failed,
/// contact (1, or 0 where no wall acted before the last frame), contact_s,
/// start_residual_over_size, start_allowed_over_size, start_frames, noise_over_size,
/// energy_gain_over_kinetic (ObservationCheck; 0 of a body that does not move),
/// velocity.{x,y,z}, angular_velocity.{x,y,z}, determined (1 or 0), with a posterior directions
/// (numbers of the fit), directions_determined, dispersion (FitPosterior); where the material is
/// determined, explained (1 or 0), rung (0 latent, 1 numbers, 2 weights) and, where frames were
/// kept, of every rung that was tried fitted_over_size.RUNG, kept_over_size.RUNG, roll_outs.RUNG,
/// seconds.RUNG; material.NAME (1 of what the law behaves like), probability.NAME,
/// reading.{mu, lambda, young, poisson, yield_stress, friction_angle, cohesion, viscosity} where it
/// has one (MaterialReading, SI units) with the ends of its 90 % interval, reading.NAME.low and
/// .high; nearest.distance and, of an analytic law, parameter.NAME and outside_range.NAME (1 where
/// it ended outside of its range).
void add_metrics(Metrics& metrics, const Inference& inference, const Observation& observation,
                 const FitVariables& variables);

/// The best mse so far of every start that was followed, over the roll-outs of all stages.
Chart loss_chart(const FitResult& fit, const FitVariables& variables, const std::string& title);

/// `columns` frames of several trajectories of the same number of frames, one row each. Points are
/// coloured by their height in the first frame; those of `clouds`, which all but the last row are
/// then, as the nearest point of the last row.
ParticlePicture frames_picture(const std::vector<std::pair<std::string, const Trajectory*>>& rows,
                               int columns, bool clouds = false);

/// Observed and fitted side by side, for a report.
Playback fit_playback(const Inference& inference, const std::string& title);

/// A trajectory of the points that holds what was observed, NaN where hidden; each has an equal
/// part of the body where it is no particle.
Trajectory observed_trajectory(const Observation& observation);

/// 64 bits of everything in the observation and the starts, beside `text`, as hexadecimal digits:
/// tells whether an interrupted fit can go on.
std::string fit_fingerprint(const Observation& observation, const FitVariables& variables,
                            const std::string& text);

}  // namespace uniphy
