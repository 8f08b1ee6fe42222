#include "uniphy/data/laboratory_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {
namespace {

/// Normal numbers that are the same on every platform (G. Box and M. Muller, Ann. Math. Stat. 29,
/// 1958).
double normal(UniformRandom& random) {
  const double radius = std::sqrt(-2 * std::log(1 - random.unit()));
  return radius * std::cos(2 * M_PI * random.unit());
}

/// `count` of the points, in random order.
std::vector<std::int64_t> shuffled_points(std::int64_t points, std::int64_t count,
                                          UniformRandom& random) {
  std::vector<std::int64_t> all(static_cast<std::size_t>(points));
  std::iota(all.begin(), all.end(), std::int64_t{0});
  for (std::int64_t k = 0; k < count; ++k)
    std::swap(all[k], all[k + static_cast<std::int64_t>(random.below(points - k))]);
  all.resize(static_cast<std::size_t>(count));
  return all;
}

/// The points that are seen in all frames, in their order; none where each frame has its own.
std::vector<std::int64_t> tracked_points(std::int64_t points, const LaboratoryView& view,
                                         UniformRandom& random) {
  if (view.cloud > 0) return {};
  const auto count = static_cast<std::int64_t>(std::llround(view.share * double(points)));
  if (count < 1) {
    throw Error(fmt::format("points.share: expected at least one of {} points, found {}", points,
                            view.share));
  }
  std::vector<std::int64_t> kept = shuffled_points(points, count, random);
  std::sort(kept.begin(), kept.end());
  return kept;
}

double size_of(const std::vector<double>& start) {
  double size = 0;
  for (int k = 0; k < 3; ++k) {
    double low = start[k], high = start[k];
    for (std::size_t i = k; i < start.size(); i += 3) {
      low = std::min(low, start[i]);
      high = std::max(high, start[i]);
    }
    size = std::max(size, high - low);
  }
  return size;
}

std::vector<double> frame_of(const Observation& o, std::int64_t frame) {
  return {o.positions(frame), o.positions(frame) + 3 * o.points()};
}

/// Whether the points of a frame are all particles of the body.
bool shows_body(const Observation& o, std::int64_t frame) {
  const std::vector<double> x = frame_of(o, frame);
  return !o.tracked() && std::none_of(x.begin(), x.end(), [](double c) { return std::isnan(c); });
}

void check_frames(const Observation& whole, const LaboratoryView& view, std::int64_t last) {
  if (last >= whole.frames || view.first + view.stride > last) {
    throw Error(
        fmt::format("frames: expected at least two of 0 to {}, found every {}th from {} to {}",
                    whole.frames - 1, view.stride, view.first, last));
  }
  if (view.first > 0 && !shows_body(whole, view.first)) {
    throw Error(
        fmt::format("frames.first: expected all particles of the body in frame {}, found an "
                    "observation that does not have them there",
                    view.first));
  }
}

void check_cloud(const Observation& whole, const LaboratoryView& view) {
  if (whole.cloud > 0) {
    throw Error("attribute correspondence of /x: expected \"points\", found \"none\"");
  }
  if (view.cloud == 0) return;
  if (view.cloud > whole.points()) {
    throw Error(fmt::format("cloud.points: expected at most {}, the points there are, found {}",
                            whole.points(), view.cloud));
  }
  if (view.share != 1 || view.hidden != 0) {
    throw Error(
        fmt::format("cloud.points: {}: expected points.share 1 and points.hidden 0, which "
                    "are of tracked points, found {} and {}",
                    view.cloud, view.share, view.hidden));
  }
}

}  // namespace

Observation laboratory_view(const Observation& whole, const LaboratoryView& view) {
  const std::int64_t last = view.last < 0 ? whole.frames - 1 : view.last;
  check_frames(whole, view, last);
  check_cloud(whole, view);
  const std::int64_t points = whole.points();
  UniformRandom random(view.seed);
  std::vector<std::int64_t> seen = tracked_points(points, view, random);
  Observation o = whole;
  o.x.clear();
  o.time.clear();
  o.frames = 0;
  if (whole.vertices.empty()) o.body = view.first > 0 ? frame_of(whole, view.first) : whole.start();
  const double size = size_of(whole.vertices.empty() ? whole.start() : whole.vertices);
  const double noise = view.noise * size;
  for (std::int64_t f = view.first; f <= last; f += view.stride) {
    if (view.cloud > 0) seen = shuffled_points(points, view.cloud, random);
    for (const std::int64_t p : seen) {
      const bool hidden = random.unit() < view.hidden;
      for (int k = 0; k < 3; ++k) {
        const double x = whole.positions(f)[3 * p + k] + noise * normal(random);
        o.x.push_back(hidden ? std::numeric_limits<double>::quiet_NaN() : std::clamp(x, 0.0, 1.0));
      }
    }
    o.time.push_back(whole.time[f]);
    ++o.frames;
  }
  o.noise = view.says_noise ? std::hypot(std::isnan(whole.noise) ? 0 : whole.noise, noise)
                            : std::numeric_limits<double>::quiet_NaN();
  const auto count = static_cast<std::int64_t>(seen.size());
  o.cloud = view.cloud;
  o.tracers.clear();
  if (view.cloud > 0) return o;
  const bool as_they_are = !whole.tracked() && count == points && view.hidden == 0;
  if (as_they_are) {
    o.body.clear();
  } else {
    o.tracers.assign(o.x.begin(), o.x.begin() + 3 * count);
  }
  return o;
}

}  // namespace uniphy
