#include "uniphy/inference/observed_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "ops/kernels/base/statistics.hpp"
#include "uniphy/inference/cloud_misses.hpp"

namespace uniphy {

double path_noise(const std::vector<double>& time, const double* c, std::int64_t points) {
  constexpr std::int64_t kEnough = 1000000;  // numbers that a median is taken of
  const std::int64_t stride =
      std::max<std::int64_t>(1, static_cast<std::int64_t>(time.size()) * 3 * points / kEnough);
  std::vector<double> seen;
  for (std::size_t f = 0; f + 3 < time.size(); ++f) {
    std::array<double, 4> weight;
    double square = 0;
    for (int i = 0; i < 4; ++i) {
      double product = 1;
      for (int j = 0; j < 4; ++j) {
        if (j != i) product *= (time[f + i] - time[f + j]) / (time[f + 3] - time[f]);
      }
      weight[i] = 1 / product;
      square += weight[i] * weight[i];
    }
    for (std::int64_t k = 0; k < 3 * points; k += stride) {
      double difference = 0;
      for (int i = 0; i < 4; ++i) difference += weight[i] * c[(f + i) * 3 * points + k];
      if (!std::isnan(difference)) seen.push_back(std::abs(difference) / std::sqrt(square));
    }
  }
  constexpr double kMedianOfNormal = 0.6745;  // of |x| for a standard deviation of 1
  return seen.empty() ? 0 : kernels::median(seen) / kMedianOfNormal;
}

double observed_noise(const Observation& observation) {
  if (observation.cloud > 0) return cloud_noise(observation);
  if (!std::isnan(observation.noise)) return observation.noise;
  return path_noise(observation.time, observation.x.data(), observation.points());
}

}  // namespace uniphy
