#include "uniphy/geometry/cloud_solid.hpp"

#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/particle_cloud.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

/// Over the mean spacing. The smoothed fraction inside of a cubic lattice is 1 to 3.5 % however it
/// is turned (the next term of Poisson's sum, 6 sinc³(1.25)); wider ones round edges more.
constexpr double kWidth = 1.25;
constexpr double kReach = 1.5;  ///< of a quadratic B-spline, in widths

double spline(double t) {
  const double a = std::abs(t);
  if (a < 0.5) return 0.75 - a * a;
  return a < kReach ? 0.5 * (kReach - a) * (kReach - a) : 0;
}

}  // namespace

std::size_t CloudSolid::CellHash::operator()(const Cell& cell) const {
  std::size_t hash = 0;
  for (const std::int64_t k : cell) hash = hash * 1000003 + static_cast<std::size_t>(k);
  return hash;
}

CloudSolid::Cell CloudSolid::cell_of(const Vector3d& p) const {
  Cell cell;
  for (int k = 0; k < 3; ++k)
    cell[k] = static_cast<std::int64_t>(std::floor(p[k] / (kReach * width_)));
  return cell;
}

CloudSolid::CloudSolid(std::vector<Vector3d> x, std::vector<double> volume)
    : x_(std::move(x)), volume_(std::move(volume)) {
  if (x_.empty() || volume_.size() != x_.size()) {
    throw Error("cloud: expected particles with a volume each, found " + std::to_string(x_.size()) +
                " and " + std::to_string(volume_.size()));
  }
  total_ = std::accumulate(volume_.begin(), volume_.end(), 0.0);
  const double spacing = std::cbrt(total_ / static_cast<double>(x_.size()));
  width_ = kWidth * spacing;
  bounds_ = bounds_of(x_);
  bounds_.min.array() -= 0.5 * spacing;
  bounds_.max.array() += 0.5 * spacing;
  for (std::size_t p = 0; p < x_.size(); ++p)
    cells_[cell_of(x_[p])].push_back(static_cast<std::int32_t>(p));
}

double CloudSolid::fraction(const Vector3d& p) const {
  const Cell home = cell_of(p);
  double sum = 0;
  for (int n = 0; n < 27; ++n) {
    const auto found =
        cells_.find({home[0] + n / 9 - 1, home[1] + n / 3 % 3 - 1, home[2] + n % 3 - 1});
    if (found == cells_.end()) continue;
    for (const std::int32_t q : found->second) {
      const Vector3d t = (p - x_[q]) / width_;
      sum += volume_[q] * spline(t[0]) * spline(t[1]) * spline(t[2]);
    }
  }
  return sum / (width_ * width_ * width_);
}

}  // namespace uniphy
