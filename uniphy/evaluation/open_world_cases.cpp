#include "uniphy/evaluation/open_world_cases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

constexpr int kDeformedAfter = 5;   ///< the part of the frames that `deformed` leaves out
constexpr int kDeformedDegree = 2;  ///< Observation::start_degree
constexpr int kFiner = 2;  ///< grid and particles along a side; the step is its square finer

/// The scene with a lattice twice as fine, on a grid twice as fine, the walls at their place.
OutsideScene finer(const OutsideScene& scene) {
  OutsideScene fine = scene;
  SceneDescription& s = fine.scene;
  BodyDescription& body = s.bodies.front();
  if (body.filling.kind != Filling::Kind::per_side)
    throw Error(
        fmt::format("{}: expected a body with a lattice of so many particles along its "
                    "side, which can be made finer",
                    scene.name));
  body.filling.count *= kFiner;
  s.grid.bound = (s.grid.bound - 1) * kFiner + 1;
  s.grid.n *= kFiner;
  *s.dt /= kFiner * kFiner;
  s.steps *= kFiner * kFiner;
  s.frame_stride *= kFiner * kFiner;
  return fine;
}

/// Means of blocks of 2×2×2 of a cubic lattice whose last index runs fastest.
std::vector<double> block_means(const std::vector<double>& x, std::int64_t frames,
                                std::int64_t side) {
  const std::int64_t n = side / kFiner;
  std::vector<double> means(static_cast<std::size_t>(3 * frames * n * n * n), 0);
  for (std::int64_t f = 0; f < frames; ++f) {
    for (std::int64_t p = 0; p < side * side * side; ++p) {
      const std::int64_t i = p / (side * side) / kFiner, j = p / side % side / kFiner,
                         k = p % side / kFiner;
      const std::int64_t q = (f * n + i) * n * n + j * n + k;
      for (int c = 0; c < 3; ++c)
        means[3 * q + c] += x[3 * (f * side * side * side + p) + c] / (kFiner * kFiner * kFiner);
    }
  }
  return means;
}

Observation observe_finer(const OutsideScene& scene, const kernels::LawDescription& law) {
  const OutsideScene fine = finer(scene);
  const Observation from = observe(fine, law);
  const std::int64_t side = fine.scene.bodies.front().filling.count;
  if (from.particles != side * side * side) {
    throw Error(fmt::format("{}: expected a cube of {} particles a side, found {} in all",
                            scene.name, side, from.particles));
  }
  const PlacedScene placed = place_scene(scene.scene);
  Observation seen = begin_observation(placed.grid, from.density, placed.volume);
  seen.frames = from.frames;
  seen.time = from.time;
  seen.x = block_means(from.x, from.frames, side);
  return seen;
}

LaboratoryView view_of(OpenWorldCase c, const Observation& whole, double noise,
                       std::uint64_t seed) {
  LaboratoryView view;
  view.seed = seed;
  if (c == OpenWorldCase::deformed) view.first = whole.frames / kDeformedAfter;
  if (c == OpenWorldCase::closed || c == OpenWorldCase::finer || c == OpenWorldCase::deformed)
    return view;
  view.noise = noise;
  if (c == OpenWorldCase::noise) {
    view.says_noise = false;  // it can be estimated
    return view;
  }
  if (c == OpenWorldCase::cloud) {
    view.stride = 2;
    view.cloud = std::max<std::int64_t>(1, whole.particles / 2);
    return view;
  }
  view.share = 0.1;
  view.stride = 10;
  if (c == OpenWorldCase::hidden) view.hidden = 1.0 / 3;
  return view;
}

/// The initial velocity of the body.
RigidMotion initial_motion(const OutsideScene& scene, const Observation& seen) {
  const BodyDescription& body = scene.scene.bodies.front();
  return {centre_of_mass(seen), body.velocity, body.angular_velocity};
}

}  // namespace

Observation seen_in(OpenWorldCase c, const Observation& whole, double noise, std::uint64_t seed) {
  Observation seen = laboratory_view(whole, view_of(c, whole, noise, seed));
  if (c == OpenWorldCase::deformed) seen.start_degree = kDeformedDegree;
  return seen;
}

const char* case_name(OpenWorldCase c) { return kOpenWorldCases[static_cast<int>(c)]; }

OpenWorldMotion open_world_motion(const OutsideScene& scene, const kernels::LawDescription& law,
                                  OpenWorldCase c, double noise, std::uint64_t seed) {
  OutsideScene moved = scene;
  moved.scene.bodies.front().law = law;
  const Observation whole =
      c == OpenWorldCase::finer ? observe_finer(moved, law) : observe(moved, law);
  OpenWorldMotion result;
  result.motion.seen = seen_in(c, whole, noise, seed);
  result.motion.name =
      fmt::format("{} in {}, {}", kernels::law_name(law.id), scene.name, case_name(c));
  if (c == OpenWorldCase::deformed) return result;  // in its own state the true law is exact
  const std::int64_t stride = view_of(c, whole, noise, seed).stride;
  for (std::int64_t f = 0; f < whole.frames; f += stride) {
    const double* x = whole.positions(f);
    result.motion.truth.insert(result.motion.truth.end(), x, x + 3 * whole.particles);
  }
  JudgedMotion exact = result.motion;
  exact.seen.body = whole.start();
  result.floor = forecast_error(exact, law, InitialState(initial_motion(moved, whole)), "float64");
  return result;
}

}  // namespace uniphy
