#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "uniphy/geometry/particle_cloud.hpp"
#include "uniphy/geometry/solid.hpp"
#include "uniphy/scene/law_origin.hpp"

namespace uniphy {

/// How a solid is filled with particles (fill.hpp).
struct Filling {
  enum class Kind {
    per_side,  ///< lattice with `count` cells along the longest side
    lattice,   ///< lattice with about `count` particles in all
    spacing,   ///< lattice with cells `spacing` m wide (after scaling)
    random     ///< exactly `count` random points
  };
  Kind kind = Kind::lattice;
  std::int64_t count = 1000;
  double spacing = 0;      ///< m
  std::uint64_t seed = 1;  ///< random
};

/// Where a body stands: its bounding box (in its own frame) is scaled, turned about its centre and
/// moved to `centre`:  x = centre + s R (p − centre of the bounds).
struct Placement {
  Eigen::Vector3d centre{0.5, 0.5, 0.5};                   ///< m
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< R
  double size = 0;  ///< m, largest side of the bounds after scaling; 0: s = 1
};

/// One body of a scene.
struct BodyDescription {
  std::string name = "body";
  /// The shape: a solid that is filled, or, where it is null, particles given one by one.
  SolidPtr solid;
  Filling filling;
  std::shared_ptr<const ParticleCloud> cloud;
  /// A cloud only: volume of each particle (m³, before scaling) where the file has none.
  double particle_volume = 0;
  /// A cloud only: the particles stay where they are; `placement` is not used, velocities turn
  /// about the centre of their bounds, and the walls are not checked beyond what the grid needs.
  bool in_place = false;

  Placement placement;
  /// The body stands on the wall that gravity points at: the centre's coordinate along gravity is
  /// set so that its surface, half a particle spacing beyond its particles, meets the plane of the
  /// innermost nodes that the wall stops.
  bool on_floor = false;
  double density = 1000;                                       ///< kg/m³
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< m/s
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< rad/s
  kernels::LawDescription law;
  LawOrigin law_origin;
};

/// How a body's own frame stands in the scene: x = centre + s R (p − own centre).
struct BodyFrame {
  double scale = 1;                                        ///< s
  Eigen::Vector3d own_centre = Eigen::Vector3d::Zero();    ///< of the bounds, in the body's frame
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();        ///< m
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< R

  Eigen::Vector3d to_scene(const Eigen::Vector3d& p) const {
    return centre + rotation * (scale * (p - own_centre));
  }
  Eigen::Vector3d to_body(const Eigen::Vector3d& x) const {
    return own_centre + rotation.transpose() * (x - centre) / scale;
  }
};
/// Of a body that has a shape or particles. Throws Error where its size is nothing.
BodyFrame frame_of(const BodyDescription& body);

/// The particles of a body as they stand in the scene; particle p is row p.
struct BodyParticles {
  std::vector<Eigen::Vector3d> x;  ///< m
  std::vector<Eigen::Vector3d> v;  ///< m/s, v = velocity + angular_velocity × (x − centre)
  std::vector<double> volume;      ///< m³ at rest: volume of the shape / number of particles
  std::vector<double> mass;        ///< kg, density · volume
};

/// Fills, places and moves the body. Throws Error that names it.
BodyParticles place_body(const BodyDescription& body);

/// Rotation by angles (degrees) about the x, then the y, then the z axis, all of them fixed in
/// space: R = Rz Ry Rx.
Eigen::Matrix3d euler_rotation(const Eigen::Vector3d& degrees);

}  // namespace uniphy
