#include "uniphy/scene/body.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/fill.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

std::vector<Vector3d> fill(const BodyDescription& body, double scale) {
  const Filling& filling = body.filling;
  switch (filling.kind) {
    case Filling::Kind::per_side:
      return fill_lattice(*body.solid, filling.count);
    case Filling::Kind::lattice:
      return fill_lattice_nearest(*body.solid, filling.count);
    case Filling::Kind::spacing:
      return fill_lattice_spacing(*body.solid, filling.spacing / scale);
    case Filling::Kind::random:
      return fill_random(*body.solid, filling.count, filling.seed);
  }
  throw Error("filling: unknown kind");
}

BodyParticles place(const BodyDescription& body) {
  if (!(std::isfinite(body.density) && body.density > 0)) {
    throw Error("density: expected a positive number, found " + std::to_string(body.density));
  }
  if (!body.solid && (!body.cloud || body.cloud->x.empty())) {
    throw Error("expected a shape or particles, found neither");
  }
  const BodyFrame frame = frame_of(body);
  const double cube = frame.scale * frame.scale * frame.scale;

  BodyParticles particles;
  if (body.solid) {
    particles.x = fill(body, frame.scale);
    const double share = body.solid->volume() * cube / static_cast<double>(particles.x.size());
    particles.volume.assign(particles.x.size(), share);
  } else {
    particles.x = body.cloud->x;
    particles.volume = body.cloud->volume;
    if (particles.volume.empty()) {
      if (!(body.particle_volume > 0)) {
        throw Error(
            "the particles have no volume: expected /volume in their file or the key "
            "particle_volume");
      }
      particles.volume.assign(particles.x.size(), body.particle_volume);
    }
    for (double& volume : particles.volume) volume *= cube;
  }

  if (!body.in_place) {
    for (Vector3d& x : particles.x) x = frame.to_scene(x);
  }
  particles.v.reserve(particles.x.size());
  for (const Vector3d& x : particles.x) {
    particles.v.push_back(body.velocity + body.angular_velocity.cross(x - frame.centre));
  }
  particles.mass.reserve(particles.volume.size());
  for (const double volume : particles.volume) particles.mass.push_back(body.density * volume);
  return particles;
}

}  // namespace

BodyFrame frame_of(const BodyDescription& body) {
  const Bounds bounds = body.solid ? body.solid->bounds() : body.cloud->bounds();
  BodyFrame frame;
  frame.own_centre = frame.centre = bounds.centre();
  if (body.in_place) return frame;
  if (body.placement.size > 0) {
    if (!(bounds.largest_side() > 0)) throw Error("size: all particles stand at one place");
    frame.scale = body.placement.size / bounds.largest_side();
  }
  frame.centre = body.placement.centre;
  frame.rotation = body.placement.rotation;
  return frame;
}

BodyParticles place_body(const BodyDescription& body) {
  try {
    return place(body);
  } catch (const Error& error) {
    throw Error("body \"" + body.name + "\": " + error.what());
  }
}

Eigen::Matrix3d euler_rotation(const Vector3d& degrees) {
  const Vector3d angles = degrees * (M_PI / 180);
  return (Eigen::AngleAxisd(angles[2], Vector3d::UnitZ()) *
          Eigen::AngleAxisd(angles[1], Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles[0], Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace uniphy
