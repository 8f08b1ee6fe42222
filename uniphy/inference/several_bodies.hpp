#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/inference/infer_run.hpp"

namespace uniphy {

/// A finished inference of several bodies.
struct BodiesInference {
  std::vector<Inference> bodies;  ///< in the order of the observed ones
  /// The number of the group of each: those that meet are in one.
  std::vector<int> group;
  /// Fits of each body, of which each sees the others as they came out of their last ones.
  std::vector<int> rounds;
  std::vector<std::filesystem::path> state_files;  ///< where it could be resumed
};

/// Fits a code to each of several bodies that share a scene. Bodies that never meet are fitted
/// each for itself. Of those that do, the roll-outs of one move the others along by the laws that
/// they have (Companion), and what is compared is its own points:
///
/// 1. Every combination of materials, the code in the middle of each, is rolled out; the best is
///    where the laws begin. Of more than kMostCombinations, one body after the other is chosen.
/// 2. The bodies are fitted in turn (adapt, z alone), in the order in which a wall or another body
///    first acts on them, until a round takes away less than kRoundShare of the error.
/// 3. Each is fitted as `adaptation` says, with the others as they are then.
///
/// That is a descent over blocks of unknowns, and each of its steps is a whole fit: one body's
/// wrong law may put the other into a wrong basin, from which a fit of z alone does not come back.
/// The posterior of a body takes the laws of the others as given. Files of the bodies are named
/// `state_file` and then the body and the round. Resumes and has the same bits as infer(). Throws
/// Error.
BodiesInference infer_bodies(const std::vector<ObservedBody>& bodies, const std::string& name,
                             const FitVariables& variables, const FitOptions& options,
                             const FitHooks& hooks, const AdaptationOptions& adaptation);

}  // namespace uniphy
