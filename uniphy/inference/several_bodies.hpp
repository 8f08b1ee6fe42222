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
  /// Fits of each body by itself.
  std::vector<int> rounds;
  std::vector<std::filesystem::path> state_files;  ///< where it could be resumed
};

/// Fits a code to each of several bodies that share a scene. Bodies that never meet are fitted
/// each for itself. Of those that do, roll-outs move all, and each is compared with its own points:
///
/// 1. Every combination of materials, the code in the middle of each, is rolled out; the best is
///    where the laws begin. Of more than kMostCombinations, one body after the other is chosen.
/// 2. The bodies are fitted in turn (adapt, z alone) and once more, in the order in which a wall or
///    another body first acts on them; the others move along by the laws that they have
///    (Companion). What one body's wrong law does to another may put that into a wrong basin: the
///    second fit tries all materials again.
/// 3. All codes and initial states are fitted at once (JointFit), and the posterior is that of all.
/// 4. Where that does not explain the motions and `adaptation` has more rungs, each is fitted as it
///    says, with the others as they are then; the posterior of a body then takes their laws as
///    given.
///
/// Files of the bodies are named `state_file` and then the body and the fit. Resumes and has the
/// same bits as infer(). Throws Error.
BodiesInference infer_bodies(const std::vector<ObservedBody>& bodies, const std::string& name,
                             const FitVariables& variables, const FitOptions& options,
                             const FitHooks& hooks, const AdaptationOptions& adaptation);

}  // namespace uniphy
