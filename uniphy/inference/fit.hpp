#pragma once

#include <torch/types.h>

#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "uniphy/inference/fit_variables.hpp"
#include "uniphy/inference/motion_objective.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {

inline constexpr const char* kLevenbergMarquardt = "levenberg_marquardt";

/// One stage of the schedule: `candidates` points, each improved by at most `epochs` roll-outs with
/// their gradients (lbfgs, adamw) or as many Jacobians (kLevenbergMarquardt), compared up to the
/// horizon.
struct FitStage {
  double horizon = 1;  ///< share of the time from first contact to the last frame, (0, 1]
  int candidates = 1;
  int epochs = 20;
  std::string optimizer = "lbfgs";
  double rate = 0.1;  ///< see DescentOptions, in units of the spread of the training codes
};

struct FitOptions {
  std::string dtype = "float32";
  std::string rollout = "fused";  ///< or stepwise, see make_motion_objective
  CloudDetail detail = CloudDetail::all;
  double prior = 0;        ///< weight of ‖z‖²/σ² against mse/size²
  double prior_sigma = 1;  ///< σ
  double pull = 0;         ///< weight of FitVariables::departure, likewise
  double clip = 10;
  std::vector<Companion> companions;  ///< other bodies of the scene, with laws that are given
  int patience = 8;  ///< a candidate is left as it is after so many evaluations without 1 % gained
  std::vector<FitStage> stages;  ///< the last one has horizon 1
};

/// In the place of the error of a start that was behind at the first horizon already.
inline constexpr double kNotRolledOut = std::numeric_limits<double>::max();

/// A point that is being improved.
struct FitCandidate {
  int start = 0;          ///< row of the starts
  torch::Tensor u;        ///< best so far in this stage, or where the stage starts
  torch::Tensor motion;   ///< likewise: what is added to the observed initial state, see
                          ///< FitProblem::leaves
  double loss = 0;        ///< of that point: mse/size² and the prior
  double mse = 0;         ///< m²
  std::string optimizer;  ///< Descent::save; of the stage before where this one has not begun
};

/// Everything that a fit depends on between two steps.
struct FitState {
  int stage = -1;                 ///< −1: the starts are not ranked yet
  int steps = 0;                  ///< of the optimizers, done in this stage
  std::vector<double> start_mse;  ///< [starts, stages] of every start at the stages' horizons;
                                  ///< infinite where it failed, or kNotRolledOut
  std::vector<FitCandidate> candidates;
  std::vector<FitRecord> history;
};

/// An end of a fit.
struct FitEnd {
  int start = 0;  ///< the start that it comes from
  std::vector<double> u;
  InitialState motion;  ///< that was used
};

struct FitResult {
  kernels::LawDescription law;
  std::vector<double> u;
  InitialState motion;            ///< initial state that was used
  double mse = 0;                 ///< m², over all frames
  int start = 0;                  ///< the start that it comes from
  std::vector<double> start_mse;  ///< [starts] over all frames, infinite where the roll-out failed;
                                  ///< or kNotRolledOut
  std::vector<FitRecord> history;
  std::vector<FitEnd> ends;    ///< of the last stage, the best first, which is the result
  int stages = 0;              ///< of the schedule; the last one sees all frames
  std::ptrdiff_t contact = 0;  ///< first frame at which a wall acts, see first_contact
  /// False where no wall acted, so that any law would have fitted, or where what was seen after it
  /// tells none of the numbers (FitPosterior::determined).
  bool determined = true;
};

struct FitHooks {
  std::filesystem::path state_file;  ///< where the fit can be resumed; empty: nowhere
  std::string fingerprint;           ///< of everything that the fit depends on
  double save_seconds = 2;           ///< least time between two saves
  std::function<void(const FitRecord&)> on_record;  ///< for every evaluation, after the step
  bool progress = true;
};

/// Algorithm 2: finds the law that makes a roll-out follow the observed positions.
///
/// 1. Every start is rolled out once up to the first horizon; the best eighth, and the best of each
///    material, then over all frames.
/// 2. The first stage begins with the best start of each material at the first horizon, the best
///    over all frames, and then the best that keep a distance from those chosen: one start that
///    fits the first moments may stand for the wrong kind of material and not leave it.
/// 3. Each stage improves its candidates; the next one keeps the best at its own,
///    longer horizon (and, but for the last stage, the best of each material first). A candidate
///    whose roll-out fails has infinite loss and goes first.
/// 4. The best evaluation over all frames is the result.
///
/// A candidate's u, and in the last stage the initial velocity, are what an optimizer of Torch
/// moves (make_candidate_fit): leaves of a graph that ends in the loss, which backward() reaches
/// through the op of the roll-out, or least squares with a Jacobian by differences.
///
/// Candidates are improved side by side; results have the same bits for any number of threads.
/// Throws Error where no start can be simulated up to the first horizon, or where the state file
/// does not belong to this fit.
FitResult fit_observation(const Observation& observation, const std::string& name,
                          const FitVariables& variables, const FitOptions& options,
                          const FitHooks& hooks = {});

/// Number of frames that a stage compares.
std::ptrdiff_t horizon_frames(double horizon, std::ptrdiff_t contact, std::ptrdiff_t frames);

/// The starts of the first stage, see fit_observation; loss_short and loss_full [starts].
std::vector<int> choose_starts(const FitVariables& variables, const std::vector<double>& loss_short,
                               const std::vector<double>& loss_full, int count);

/// The state on disk (HDF5, format "uniphy-fit-state"). read throws Error where the file is damaged
/// or its fingerprint is another.
void write_fit_state(const std::filesystem::path& file, const FitState& state,
                     const std::string& fingerprint);
FitState read_fit_state(const std::filesystem::path& file, const std::string& fingerprint);
/// Throws Error where the attribute of / is another one.
void check_fingerprint(const hdf5::Reader& reader, const std::string& fingerprint);

}  // namespace uniphy
