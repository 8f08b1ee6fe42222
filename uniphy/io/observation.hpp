#pragma once

// observation.h5: what inference may see, and nothing about the material.
//
//   attributes  format = "uniphy-observation", version = 1 or 2
//   /x      [frames, points, 3]     m   observed positions; NaN where a point is hidden
//           attribute noise (m), optional: standard deviation of a coordinate
//           attribute correspondence, optional: "points" (the default: row p is one point in all
//           frames) or, in version 2, "none" (each frame is a cloud: another number of points in
//           any order, rows of NaN, anywhere in a frame, up to the largest; a frame may be empty,
//           the first one too, but for two)
//           attribute start_degree, optional: 0 to 3 (Observation::start_degree)
//   /time   [frames]                s   increasing, at any times
//   /scene  attributes: grid (nodes a side), dt (s), gravity [3] (m/s^2),
//           walls ("freeslip" or "noslip"), bound (wall thickness in nodes), density (kg/m^3)
//
// Version 1: the points are the particles of the body, all of them seen in the first frame.
//   /volume [particles]             m^3 volume of each particle at rest
//
// Version 2: the body as it stands at the first frame and points on it that are not
// its particles.
//   /body/x [particles, 3]          m   particles, a dense cloud
//   /body/volume [particles]        m^3 volume of each at rest
// or, in their place, a closed surface that the fit fills with particles:
//   /body/vertices [vertices, 3]    m
//   /body/triangles [triangles, 3]  rows of vertices, from 0
//
// Of several bodies, in version 2, each is in a group of its own, with the times and the scene of
// all in common:
//   /bodies/NAME/x                      as /x, with its attributes
//   /bodies/NAME/volume                 the points are the particles, as in version 1
//   /bodies/NAME/body/...               or they are not, as /body
//           attribute density (kg/m^3) of /bodies/NAME, optional: in the place of that of /scene

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"

namespace uniphy {

/// Largest Observation::start_degree. Of the third, 180 numbers are fitted.
inline constexpr int kMostStartDegree = 3;

struct Observation {
  std::int64_t frames = 0;
  std::int64_t particles = 0;  ///< of the body; 0 while it is a surface
  std::vector<double> x;       ///< [frames, points, 3] m, NaN where hidden
  std::vector<double> time;    ///< [frames] s, increasing
  std::vector<double> volume;  ///< [particles] m^3
  /// Standard deviation of the noise of a coordinate, m; NaN: not known.
  double noise = std::numeric_limits<double>::quiet_NaN();
  /// 0: at the first frame the body is undeformed and moves as a rigid one; else the degree of the
  /// polynomials in the place that its velocity and stretch there are fitted as.
  int start_degree = 0;

  /// [particles, 3] m, the body at the first frame; empty: point p is particle p, and stands where
  /// the first frame has it.
  std::vector<double> body;
  /// [points, 3] m, where the points are at the first frame, NaN where that is not known; empty:
  /// point p is particle p.
  std::vector<double> tracers;
  std::int64_t cloud = 0;  ///< rows of a frame without correspondence; 0: rows are tracked points
  /// How the body is compared with a cloud: "transport", "chamfer" or "nearest"
  /// (ops::CloudDistance). A choice of the fit, not in the file.
  std::string cloud_distance = "transport";
  std::vector<double> vertices;  ///< [vertices, 3] m, the surface of a body without particles
  std::vector<std::int64_t> triangles;  ///< [triangles, 3]
  /// Seconds from the first frame after which another body acts on this one, if one ever does.
  /// Found by the fit, not in the file.
  double meeting = std::numeric_limits<double>::infinity();

  int grid = 20;
  double dt = 0;  ///< s, of the simulation that explains the observation
  std::array<double, 3> gravity{0, -9.8, 0};
  std::string walls = "freeslip";
  int bound = 3;
  double density = 1000;  ///< kg/m^3

  bool tracked() const { return !tracers.empty(); }  ///< the points are tracers
  /// Rows of a frame.
  std::int64_t points() const {
    if (cloud > 0) return cloud;
    return tracked() ? static_cast<std::int64_t>(tracers.size() / 3) : particles;
  }
  const double* positions(std::int64_t frame) const { return x.data() + frame * points() * 3; }
  /// [particles, 3] m, where a roll-out starts from.
  std::vector<double> start() const;
  bool shows_any(std::int64_t frame) const;  ///< whether the frame has a point
  bool is_seen(std::int64_t frame, std::int64_t point) const {
    return positions(frame)[3 * point] == positions(frame)[3 * point];
  }
};

/// What is known of a scene of one body besides its motion, without any frame; grid.dt is the time
/// step.
Observation begin_observation(const kernels::GridSettings& grid, double density,
                              const std::vector<double>& volume);
/// Adds the positions x [points, 3] at `time`.
void add_frame(Observation& observation, double time, const std::vector<double>& x);

/// Version 1 where the points are the particles, else version 2. Throws Error for what
/// read_observation would refuse.
void write_observation(const std::filesystem::path& file, const Observation& observation);
/// Throws Error for anything that is missing, of the wrong shape, not finite, or out of range, and
/// for a file of several bodies.
Observation read_observation(const std::filesystem::path& file);

/// One of the bodies of an observation; its name is a folder's, too (is_plain_name).
struct ObservedBody {
  std::string name;
  Observation motion;
};
/// The bodies of a file, sorted by their names; the only one of a file without /bodies has none.
/// Throws like read_observation.
std::vector<ObservedBody> read_observed_bodies(const std::filesystem::path& file);
/// One body without a name as write_observation does. Throws Error where times or scenes (but for
/// the density) differ, and for what read_observed_bodies would refuse.
void write_observed_bodies(const std::filesystem::path& file,
                           const std::vector<ObservedBody>& bodies);

}  // namespace uniphy
