#include "uniphy/data/trajectory_setup.hpp"

#include <algorithm>
#include <cmath>

#include "uniphy/data/random_rotation.hpp"
#include "uniphy/data/random_streams.hpp"
#include "uniphy/geometry/fill.hpp"
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
  std::array<double, 5> unit;
  for (double& u : unit) u = random.unit();
  if (2 * attempt < o.attempts) {
    const std::uint64_t strata =
        stream_seed(scramble(o.seed) ^ static_cast<std::uint64_t>(o.split), Stream::strata,
                    static_cast<std::uint64_t>(trajectory / o.trajectories), 0);
    unit = LatinHypercube(o.trajectories, strata).point(trajectory % o.trajectories, unit);
  }
  return material_at(o.material_of(trajectory), unit);
}

struct Body {
  std::string shape;
  std::vector<Vector3d> x;  ///< about the origin, m
  double volume = 0;        ///< m³
  double spacing = 0;       ///< m
};

Body draw_body(const GenerateOptions& o, std::int64_t trajectory, std::int64_t attempt) {
  UniformRandom random = stream(o, Stream::body, trajectory, attempt);
  const auto& shapes = o.split == Split::heldout_all ? o.heldout_shapes : o.shapes;
  Body body;
  body.shape = shapes[random.below(shapes.size())];
  const SolidPtr solid = make_shape(body.shape, 1 + random.below(1u << 20));
  const Bounds bounds = solid->bounds();
  const double scale = random.log_between(o.size[0], o.size[1]) / bounds.largest_side();
  const Eigen::Matrix3d rotation = random_rotation(random);
  body.x = fill_lattice_nearest(*solid, o.particles);
  for (Vector3d& x : body.x) x = scale * (rotation * (x - bounds.centre()));
  body.volume = scale * scale * scale * solid->volume();
  body.spacing = std::cbrt(body.volume / static_cast<double>(body.x.size()));
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

/// The shift that puts the body at m.gap from the wall that it moves to (less by the ratio of the
/// velocities for the walls that it moves to more slowly), anywhere along the axes that it does not
/// move along. `low`, `high` (m) hold what the walls leave free.
Vector3d place(const Body& body, const Motion& m, double low, double high) {
  Vector3d first = body.x.front(), last = body.x.front(), shift;
  for (const Vector3d& x : body.x) {
    first = first.cwiseMin(x);
    last = last.cwiseMax(x);
  }
  const double lead = m.direction.cwiseAbs().maxCoeff();
  for (int axis = 0; axis < 3; ++axis) {
    const double least = low + 0.5 * body.spacing - first[axis];
    const double most = std::max(least, high - 0.5 * body.spacing - last[axis]);
    const double share = m.direction[axis] / lead;
    double wanted = least + (most - least) * m.place[axis];
    if (share < 0) wanted = least - share * m.gap;
    if (share > 0) wanted = most - share * m.gap;
    shift[axis] = std::clamp(wanted, least, most);
  }
  return shift;
}

}  // namespace

double stable_time_step(const LawDescription& law, double density, double dx) {
  const double wave = 0.5 * dx / wave_speed(law, density);
  if (law.id != kernels::LawId::newtonian) return wave;
  return std::min(wave, density * dx * dx / (8 * law.mu));
}

TrajectorySetup draw_setup(const GenerateOptions& o, std::int64_t trajectory,
                           std::int64_t attempt) {
  TrajectorySetup setup;
  setup.law = draw_law(o, trajectory, attempt);
  setup.grid = o.grid;
  const double stable = stable_time_step(setup.law, o.density, setup.grid.dx());
  setup.grid.dt = std::min(o.dt.value_or(stable), stable);
  setup.steps = o.steps;

  const Body body = draw_body(o, trajectory, attempt);
  const double duration = static_cast<double>(o.steps) * setup.grid.dt;
  const Motion motion = draw_motion(o, setup.law, duration, trajectory, attempt);
  const double wall = o.grid.bound * o.grid.dx();
  const Vector3d shift = place(body, motion, wall, 1 - wall);
  std::vector<double> x, v;
  Vector3d low = body.x.front(), high = low;
  for (const Vector3d& p : body.x) {
    const Vector3d at = p + shift;
    const Vector3d velocity = motion.speed * motion.direction + motion.angular.cross(p);
    x.insert(x.end(), at.data(), at.data() + 3);
    v.insert(v.end(), velocity.data(), velocity.data() + 3);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  setup.size = (high - low).maxCoeff() + body.spacing;
  setup.motion = motion.kind;
  setup.initial = kernels::ParticleState<double>::undeformed(std::move(x), std::move(v));
  setup.volume.assign(body.x.size(), body.volume / static_cast<double>(body.x.size()));
  setup.mass.assign(body.x.size(), o.density * setup.volume.front());

  setup.record.material = kernels::law_name(setup.law.id);
  setup.record.parameters = parameters_of(setup.law);
  setup.record.dt = setup.grid.dt;
  setup.record.density = o.density;
  setup.record.seed = static_cast<std::int64_t>(o.seed);
  setup.record.shape = body.shape;
  return setup;
}

}  // namespace uniphy
