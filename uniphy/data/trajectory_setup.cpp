#include "uniphy/data/trajectory_setup.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/data/random_rotation.hpp"
#include "uniphy/data/random_streams.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using kernels::LawDescription;

/// Strain of the impact (speed over wave speed) that soft bodies are spared: beyond, the material
/// point method tears them apart whatever the law.
constexpr double kLargestImpact = 0.4;
/// Part of the run in which every body has arrived at its first wall.
constexpr double kArrival = 0.3;

UniformRandom stream(const GenerateOptions& o, Stream which, std::int64_t trajectory,
                     std::int64_t attempt) {
  // What a held-out set shares with train it draws from train's streams.
  const bool own = o.split == Split::heldout_all ||
                   (o.split == Split::heldout_materials && which == Stream::material);
  const std::uint64_t set = own ? static_cast<std::uint64_t>(o.split) : 0;
  return UniformRandom(stream_seed(scramble(o.seed) ^ set, which,
                                   static_cast<std::uint64_t>(trajectory),
                                   static_cast<std::uint64_t>(attempt)));
}

LawDescription draw_law(const GenerateOptions& o, std::int64_t trajectory, std::int64_t attempt) {
  UniformRandom random = stream(o, Stream::material, trajectory, attempt);
  MaterialParameters unit;
  for (double& u : unit) u = random.unit();
  if (2 * attempt < o.attempts) {
    const std::uint64_t strata =
        stream_seed(scramble(o.seed) ^ static_cast<std::uint64_t>(o.split), Stream::strata,
                    static_cast<std::uint64_t>(trajectory / o.trajectories), 0);
    unit = LatinHypercube(o.trajectories, strata).point(trajectory % o.trajectories, unit);
  }
  return material_at(o.material_of(trajectory), unit);
}

/// A body of its own shape, size and turn about the origin, at rest.
BodyDescription draw_body(const GenerateOptions& o, std::int64_t trajectory, std::int64_t attempt,
                          std::string& shape) {
  UniformRandom random = stream(o, Stream::body, trajectory, attempt);
  const auto& shapes = o.split == Split::heldout_all ? o.heldout_shapes : o.shapes;
  shape = shapes[random.below(shapes.size())];
  BodyDescription body;
  body.name = shape;
  body.solid = make_shape(shape, 1 + random.below(1u << 20));
  body.filling.kind = Filling::Kind::lattice;
  body.filling.count = o.particles;
  body.placement.centre = Vector3d::Zero();
  body.placement.size = random.log_between(o.size[0], o.size[1]);
  body.placement.rotation = random_rotation(random);
  body.density = o.density;
  return body;
}

struct Motion {
  std::string kind;
  Vector3d direction = Vector3d::Zero();
  double speed = 0, gap = 0;
  Vector3d angular = Vector3d::Zero();
  Vector3d place = Vector3d::Zero();  ///< in [0, 1)³, used where no wall is near
};

/// Speeds that make the material yield where it can: the strain of an impact is about the speed
/// over the wave speed.
double draw_speed(const GenerateOptions& o, const LawDescription& law, UniformRandom& random) {
  const double u = random.unit(), c = wave_speed(law, o.density);
  const double k = law.id == kernels::LawId::sand ? 0 : yield_norm(law, 0);
  double speed;
  if (k > 0 && k < kLargestImpact) {
    const auto [low, high] = o.impact_over_yield;
    speed = c * k * low * std::exp(std::log(high / low) * u);
  } else {
    const double high = std::clamp(kLargestImpact * c, o.speed[0], o.speed[1]);
    speed = o.speed[0] * std::exp(std::log(high / o.speed[0]) * u);
  }
  return std::clamp(speed, o.speed[0], o.speed[1]);
}

Motion draw_motion(const GenerateOptions& o, const LawDescription& law, double duration,
                   std::int64_t trajectory, std::int64_t attempt) {
  UniformRandom random = stream(o, Stream::motion, trajectory, attempt);
  Motion m;
  m.kind = o.motions[random.below(o.motions.size())];
  m.speed = draw_speed(o, law, random);
  const double sign_x = random.unit() < 0.5 ? -1 : 1, sign_z = random.unit() < 0.5 ? -1 : 1;
  const Vector3d any = random.direction();
  if (m.kind == "falling") m.direction = Vector3d(0, -1, 0);
  if (m.kind == "left") m.direction = Vector3d(-1, 0, 0);
  if (m.kind == "right") m.direction = Vector3d(1, 0, 0);
  if (m.kind == "diagonal") m.direction = Vector3d(sign_x, -1, sign_z).normalized();
  if (m.kind == "random") m.direction = any;
  const bool spins = random.unit() < 0.5;
  const double turn = random.between(o.angular_speed[0], o.angular_speed[1]);
  const Vector3d axis = random.direction();
  if (spins) m.angular = turn * axis;
  m.gap = std::min(random.between(o.gap[0], o.gap[1]), m.speed * kArrival * duration);
  m.place = random.in_box(Vector3d::Zero(), Vector3d::Ones());
  return m;
}

/// The centre that puts the body at m.gap from the wall that it moves to (less by the ratio of the
/// velocities for the walls that it moves to more slowly), anywhere along the axes that it does not
/// move along. `wall` (m) is how thick the walls are.
Vector3d place(const BodyDescription& body, const Motion& m, double wall) {
  const BodyParticles particles = place_body(body);
  const Bounds bounds = bounds_of(particles.x);
  Vector3d centre;
  const double margin = 0.5 * std::cbrt(particles.volume.front());
  const double lead = m.direction.cwiseAbs().maxCoeff();
  for (int axis = 0; axis < 3; ++axis) {
    const double least = wall + margin - bounds.min[axis];
    const double most = std::max(least, 1 - wall - margin - bounds.max[axis]);
    const double share = m.direction[axis] / lead;
    double wanted = least + (most - least) * m.place[axis];
    if (share < 0) wanted = least - share * m.gap;
    if (share > 0) wanted = most - share * m.gap;
    centre[axis] = std::clamp(wanted, least, most);
  }
  return centre;
}

/// The fixed step where it is stable, else (and for `auto`) what the stiffness allows.
double time_step(const GenerateOptions& o, const LawDescription& law) {
  const Stiffness stiffness = estimate_stiffness(law);
  const auto allowed = [&](double safety) {
    return stable_time_step(stiffness, o.density, o.grid.dx(), o.speed[1], safety);
  };
  if (o.dt && *o.dt <= allowed(kFixedStepSafety)) return *o.dt;
  return round_time_step(allowed(o.dt ? kFixedStepSafety : kTimeStepSafety));
}

}  // namespace

TrajectorySetup draw_setup(const GenerateOptions& o, std::int64_t trajectory,
                           std::int64_t attempt) {
  TrajectorySetup setup;
  BodyDescription body = draw_body(o, trajectory, attempt, setup.record.shape);
  body.law = draw_law(o, trajectory, attempt);
  setup.scene.grid = o.grid;
  setup.scene.steps = o.steps;
  const double dt = time_step(o, body.law);
  setup.scene.dt = dt;

  const Motion motion =
      draw_motion(o, body.law, static_cast<double>(o.steps) * dt, trajectory, attempt);
  setup.motion = motion.kind;
  body.velocity = motion.speed * motion.direction;
  body.angular_velocity = motion.angular;
  body.placement.centre = place(body, motion, o.grid.bound * o.grid.dx());

  setup.record.material = kernels::law_name(body.law.id);
  setup.record.parameters = parameters_of(body.law);
  setup.record.dt = dt;
  setup.record.density = o.density;
  setup.record.seed = static_cast<std::int64_t>(o.seed);
  setup.record.attempt = attempt;
  setup.scene.bodies.push_back(std::move(body));
  return setup;
}

}  // namespace uniphy
