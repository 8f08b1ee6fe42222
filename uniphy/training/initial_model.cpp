#include "uniphy/training/initial_model.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {

torch::Tensor initial_latents(const LawColumns& columns, std::int64_t latent_size,
                              torch::Generator& generator) {
  const std::int64_t n = columns.trajectories();
  torch::Tensor z = torch::randn({n, latent_size}, generator, torch::kFloat32) * 0.1;
  for (std::int64_t i = 0; i < n; ++i) {
    const TrajectoryScale& s = columns.scales[i];
    if (s.stress > 0) z[i][0] = std::log(s.stress / kernels::kStressScale) / kernels::kStressRate;
    if (latent_size > 1 && s.strain > 0)
      z[i][1] = std::log(std::min(std::max(s.strain, 1e-3), 0.5) / kernels::kStrainScale) /
                kernels::kStrainRate;
  }
  return z;
}

models::TrainedModel initial_model(const Dataset& data, const LawColumns& columns,
                                   const models::LearnedLawOptions& options,
                                   torch::Generator& generator) {
  models::TrainedModel model;
  model.law = models::LearnedLaw(options, generator);
  std::vector<std::string> materials;
  std::vector<MaterialParameters> parameters;
  for (const TrajectoryRecord& t : data.trajectories) {
    materials.push_back(t.material);
    parameters.push_back(t.parameters);
  }
  model.codes = models::LatentCodes(initial_latents(columns, options.latent_size, generator),
                                    materials, parameters);
  return model;
}

}  // namespace uniphy
