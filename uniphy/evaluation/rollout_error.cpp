#include "uniphy/evaluation/rollout_error.hpp"

#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/dataset_setup.hpp"
#include "uniphy/report/for_each_with_progress.hpp"
#include "uniphy/scene/comparison.hpp"

namespace uniphy {
namespace {

RolloutError compare(const Trajectory& truth, const TrajectorySetup& setup,
                     const kernels::LawDescription& law) {
  RolloutError error;
  error.root_over_size = std::numeric_limits<double>::infinity();
  try {
    const double root =
        compare_trajectories(roll_out(setup, law), truth, FrameMatch::all).root_over_size;
    if (std::isfinite(root)) {
      error.root_over_size = root;
    } else {
      error.failure = "positions are not finite";
    }
  } catch (const Error& failed) {
    error.failure = failed.what();
  }
  return error;
}

}  // namespace

Trajectory roll_out(const TrajectorySetup& setup, const kernels::LawDescription& law) {
  SceneDescription scene = setup.scene;
  scene.bodies.front().law = law;
  return run_scene(scene);
}

std::vector<RolloutError> rollout_errors(const std::vector<TrajectorySetup>& setups,
                                         const std::vector<kernels::LawDescription>& laws) {
  std::vector<RolloutError> errors(setups.size());
  for_each_with_progress("roll out", "trajectories", static_cast<std::int64_t>(setups.size()),
                         [&](std::int64_t i) {
                           const Trajectory truth = roll_out(setups[i], setups[i].law());
                           errors[i] = compare(truth, setups[i], laws[i]);
                         });
  return errors;
}

std::vector<TrajectorySetup> setups_of(const Dataset& data) {
  std::vector<TrajectorySetup> setups;
  for (std::size_t i = 0; i < data.trajectories.size(); ++i) {
    setups.push_back(setup_of(data, static_cast<std::int64_t>(i)));
  }
  return setups;
}

std::vector<kernels::LawDescription> learned_laws(
    const std::shared_ptr<const kernels::LearnedLawWeights>& weights,
    const std::vector<double>& latents) {
  const auto size = static_cast<std::size_t>(weights->latent_size);
  std::vector<kernels::LawDescription> laws(size == 0 ? 0 : latents.size() / size);
  for (std::size_t i = 0; i < laws.size(); ++i) {
    laws[i].id = kernels::LawId::learned;
    laws[i].weights = weights;
    laws[i].z.assign(latents.begin() + i * size, latents.begin() + (i + 1) * size);
  }
  return laws;
}

}  // namespace uniphy
