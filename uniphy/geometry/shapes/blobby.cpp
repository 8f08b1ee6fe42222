#include "uniphy/geometry/shapes/blobby.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "uniphy/geometry/random.hpp"

namespace uniphy {

using Eigen::Vector3d;

Blobby::Blobby(int count, double radius, double smoothing, std::uint64_t seed)
    : smoothing_(smoothing) {
  check_parameter(count >= 1 && count <= 1000, "blobby", "count", count, "a number from 1 to 1000");
  check_positive("blobby", "radius", radius);
  check_positive("blobby", "smoothing", smoothing);
  UniformRandom random(seed);
  balls_.push_back({Vector3d::Zero(), radius});
  while (balls_.size() < static_cast<std::size_t>(count)) {
    const Ball& neighbour = balls_[random.below(balls_.size())];
    const double own = radius * random.between(0.6, 1.0);
    const Vector3d centre =
        neighbour.centre + random.direction() * (0.65 * (neighbour.radius + own));
    balls_.push_back({centre, own});
  }
  Bounds loose{balls_[0].centre, balls_[0].centre};
  const double bulge = smoothing * std::log(static_cast<double>(count));
  for (const Ball& ball : balls_) {
    const Vector3d reach = Vector3d::Constant(ball.radius + bulge);
    loose.min = loose.min.cwiseMin(ball.centre - reach);
    loose.max = loose.max.cwiseMax(ball.centre + reach);
  }
  bounds_ = tight_bounds(*this, loose, 1e-3 * loose.largest_side());
}

double Blobby::distance(const Vector3d& p) const {
  // Shifted by the smallest distance, so that no exponential overflows.
  double nearest = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls_) {
    nearest = std::min(nearest, (p - ball.centre).norm() - ball.radius);
  }
  double sum = 0;
  for (const Ball& ball : balls_) {
    sum += std::exp((nearest - (p - ball.centre).norm() + ball.radius) / smoothing_);
  }
  return nearest - smoothing_ * std::log(sum);
}

}  // namespace uniphy
