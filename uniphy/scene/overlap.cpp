#include "uniphy/scene/overlap.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <unordered_map>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr double kBall = 2.5;        // spacings: 65 particles in a full ball
constexpr double kFilled = 0.8;      // half of it beside a flat surface, 3 σ less at random
constexpr double kSamePlace = 1e-3;  // spacings
constexpr double kSkin = 1e-9;       // of the largest side: rounding of the placement

/// Whether x lies inside the box, at least `margin` from its faces.
bool holds(const Bounds& box, const Vector3d& x, double margin) {
  return ((x - box.min).array() >= margin).all() && ((box.max - x).array() >= margin).all();
}

/// Particles of a cloud, found by place.
class CloudIndex {
 public:
  explicit CloudIndex(const BodyParticles& particles)
      : particles_(particles),
        spacing_(std::cbrt(std::accumulate(particles.volume.begin(), particles.volume.end(), 0.0) /
                           static_cast<double>(particles.volume.size()))),
        box_(bounds_of(particles.x)) {
    for (std::size_t p = 0; p < particles.x.size(); ++p) {
      cells_[key(cell(particles.x[p]))].push_back(static_cast<std::int32_t>(p));
    }
  }

  /// Whether x is matter of the cloud; with `same_place` only where it is one of its particles.
  bool takes(const Vector3d& x, bool same_place) const {
    const double radius = kBall * spacing_;
    if (!holds(box_, x, -radius)) return false;
    const std::array<std::int64_t, 3> at = cell(x);
    double volume = 0;
    for (int k = 0; k < 27; ++k) {
      const auto found =
          cells_.find(key({at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1}));
      if (found == cells_.end()) continue;
      for (const std::int32_t p : found->second) {
        const double distance = (particles_.x[p] - x).norm();
        if (distance < kSamePlace * spacing_) return true;
        if (distance < radius) volume += particles_.volume[p];
      }
    }
    return !same_place && volume > kFilled * 4 / 3 * M_PI * radius * radius * radius;
  }

 private:
  std::array<std::int64_t, 3> cell(const Vector3d& x) const {
    const Vector3d c = (x - box_.min) / (kBall * spacing_);
    return {static_cast<std::int64_t>(std::floor(c[0])),
            static_cast<std::int64_t>(std::floor(c[1])),
            static_cast<std::int64_t>(std::floor(c[2]))};
  }
  /// Cells that share a key only cost time.
  static std::uint64_t key(const std::array<std::int64_t, 3>& cell) {
    std::uint64_t k = 0;
    for (const std::int64_t c : cell) k = k * 0x9e3779b97f4a7c15ULL + static_cast<std::uint64_t>(c);
    return k;
  }

  const BodyParticles& particles_;
  double spacing_;
  Bounds box_;
  std::unordered_map<std::uint64_t, std::vector<std::int32_t>> cells_;
};

/// The first particle of `x` that lies inside the solid of `body`, or null.
const Vector3d* first_inside(const std::vector<Vector3d>& x, const BodyDescription& body) {
  const BodyFrame frame = frame_of(body);
  const Bounds bounds = body.solid->bounds();
  const double skin = kSkin * bounds.largest_side();
  for (const Vector3d& p : x) {
    const Vector3d own = frame.to_body(p);
    if (!holds(bounds, own, skin) || !body.solid->inside(own)) continue;
    return &p;
  }
  return nullptr;
}

const Vector3d* first_inside(const std::vector<Vector3d>& x, const CloudIndex& cloud,
                             bool same_place) {
  for (const Vector3d& p : x) {
    if (cloud.takes(p, same_place)) return &p;
  }
  return nullptr;
}

}  // namespace

void check_overlap(const std::vector<BodyDescription>& bodies,
                   const std::vector<BodyParticles>& particles) {
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (a == b) continue;
      const BodyDescription& guest = bodies[a];
      const BodyDescription& host = bodies[b];
      const Vector3d* at = nullptr;
      if (host.solid) {
        at = first_inside(particles[a].x, host);
      } else if (!guest.solid) {
        at =
            first_inside(particles[a].x, CloudIndex(particles[b]), guest.in_place && host.in_place);
      }
      if (at == nullptr) continue;
      throw Error(
          fmt::format("bodies \"{}\" and \"{}\" overlap: expected bodies apart from each other or "
                      "just touching, "
                      "found a particle of \"{}\" at ({:.4g}, {:.4g}, {:.4g}) m inside \"{}\"",
                      bodies[std::min(a, b)].name, bodies[std::max(a, b)].name, guest.name,
                      (*at)[0], (*at)[1], (*at)[2], host.name));
    }
  }
}

}  // namespace uniphy
