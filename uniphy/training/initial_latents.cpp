#include "uniphy/training/initial_latents.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {

torch::Tensor initial_latents(const LawColumns& columns, const NetworkOptions& network,
                              torch::Generator& generator) {
  const std::int64_t n = std::int64_t(columns.scales.size());
  torch::Tensor z = torch::randn({n, network.latent_size}, generator, torch::kFloat32) * 0.1;
  for (std::int64_t i = 0; i < n; ++i) {
    const TrajectoryScale& s = columns.scales[i];
    if (s.stress > 0) z[i][0] = std::log(s.stress / kernels::kStressScale) / kernels::kStressRate;
    if (network.latent_size > 1 && network.form == kernels::LawForm::isotropic && s.strain > 0)
      z[i][1] = std::log(std::min(std::max(s.strain, 1e-3), 0.5) / kernels::kStrainScale) /
                kernels::kStrainRate;
  }
  return z.requires_grad_();
}

}  // namespace uniphy
