#include "uniphy/inference/cloud_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/loss/cloud_residuals.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/inference/cloud_misses.hpp"
#include "uniphy/inference/observed_motion.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// At most `most` of the rows, drawn, in their order.
std::vector<std::int64_t> some_of(std::vector<std::int64_t> rows, std::int64_t most,
                                  UniformRandom& random) {
  const auto count = static_cast<std::int64_t>(rows.size());
  if (count <= most) return rows;
  for (std::int64_t k = 0; k < most; ++k)
    std::swap(rows[k], rows[k + static_cast<std::int64_t>(random.below(count - k))]);
  rows.resize(static_cast<std::size_t>(most));
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// [frames, at most `most`, 3], rows of NaN behind the points of a frame.
Tensor clouds_of(const Observation& o, std::int64_t most, UniformRandom& random) {
  std::vector<std::vector<std::int64_t>> rows(static_cast<std::size_t>(o.frames));
  std::size_t largest = 1;
  for (std::int64_t f = 0; f < o.frames; ++f) {
    for (std::int64_t p = 0; p < o.points(); ++p) {
      if (o.is_seen(f, p)) rows[f].push_back(p);
    }
    rows[f] = some_of(std::move(rows[f]), most, random);
    largest = std::max(largest, rows[f].size());
  }
  Tensor clouds = torch::full({o.frames, std::int64_t(largest), 3},
                              std::numeric_limits<double>::quiet_NaN(), torch::kFloat64);
  for (std::int64_t f = 0; f < o.frames; ++f) {
    double* to = clouds[f].data_ptr<double>();
    for (const std::int64_t p : rows[f]) to = std::copy_n(o.positions(f) + 3 * p, 3, to);
  }
  return clouds;
}

ops::CloudDistance distance_of(const std::string& name) {
  if (name == "nearest") return ops::CloudDistance::nearest;
  if (name == "chamfer") return ops::CloudDistance::chamfer;
  if (name == "transport") return ops::CloudDistance::transport;
  throw Error("cloud_distance: expected transport, chamfer or nearest, found \"" + name + "\"");
}

}  // namespace

CloudComparison::CloudComparison(const Observation& o, CloudDetail detail) {
  const std::int64_t most = detail == CloudDetail::all ? kMostCloudPoints : kRoughCloudPoints;
  UniformRandom random(1);
  std::vector<std::int64_t> rows(static_cast<std::size_t>(o.particles));
  std::iota(rows.begin(), rows.end(), std::int64_t{0});
  rows = some_of(std::move(rows), most, random);
  Tensor weights = torch::tensor(o.volume, torch::kFloat64);
  const double volume = weights.sum().item<double>();
  const auto count = static_cast<std::int64_t>(rows.size());
  if (count < o.particles) {
    particles_ = torch::tensor(rows);
    weights = weights.index_select(0, particles_);
  }
  const Tensor clouds = clouds_of(o, most, random);
  ops::CloudSettings settings;
  settings.distance = distance_of(o.cloud_distance);
  settings.blur = ops::default_blur(volume, count);
  targets_ = std::make_shared<const ops::CloudTargets>(clouds, weights, settings);
  columns_ = targets_->residuals_per_frame();
  const auto empty = clouds.select(2, 0).isnan().all(1).sum().item<std::int64_t>();
  seen_per_frame_ = double(columns_) * double(o.frames - empty) / double(o.frames);
}

Tensor CloudComparison::residuals(const Tensor& x) const {
  const Tensor of_all = particles_.defined() ? x.index_select(1, particles_) : x;
  return targets_->residuals(of_all.contiguous()) * std::sqrt(double(columns_) / 3);
}

CloudMisses cloud_misses(const Observation& o, const std::vector<double>& x) {
  const torch::NoGradGuard no_grad;
  const CloudComparison comparison(o, CloudDetail::all);
  const Tensor square =
      comparison.residuals(torch::tensor(x, torch::kFloat64).view({o.frames, -1, 3})).square();
  const Tensor sums = square.sum(1), points = square.view({o.frames, -1, 3}).sum(2).amax(1);
  CloudMisses m;
  for (std::int64_t f = 0; f < o.frames; ++f) {
    m.root.push_back(std::sqrt(sums[f].item<double>() / double(comparison.columns())));
    m.largest.push_back(std::sqrt(points[f].item<double>()));
  }
  m.over_all =
      std::sqrt(sums.sum().item<double>() / (comparison.seen_per_frame() * double(o.frames)));
  return m;
}

double cloud_noise(const Observation& o) {
  if (o.shows_any(0)) return cloud_misses(some_frames(o, {0}), o.start()).over_all;
  const double volume = std::accumulate(o.volume.begin(), o.volume.end(), 0.0);
  return ops::default_blur(volume, o.particles);
}

}  // namespace uniphy
