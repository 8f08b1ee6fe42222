#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/geometry/solid.hpp"

namespace uniphy {

/// The smallest box round the points, of which there is at least one.
Bounds bounds_of(const std::vector<Eigen::Vector3d>& points);

/// Particles given one by one.
struct ParticleCloud {
  std::vector<Eigen::Vector3d> x;  ///< m
  /// m³ of each particle: as long as x, or empty where the file has none.
  std::vector<double> volume;
  bool of_trajectory = false;  ///< positions of particles that were deformed and in motion
  /// Of a trajectory whose run failed (trajectory.hpp): why; else empty.
  std::string failure = {};

  Bounds bounds() const { return bounds_of(x); }
};

/// Reads particles: from an HDF5 file (ends in .h5 or .hdf5) the dataset /x, [particles, 3] or
/// [frames, particles, 3] (then `frame`), and /volume [particles] where there is one; from any
/// other file text, three numbers a line, apart by blanks, commas or semicolons; lines that start
/// with # are skipped, and one line of column names may stand first. Throws Error naming the file
/// and the line or dataset.
ParticleCloud read_particles(const std::filesystem::path& file, std::int64_t frame = 0);
/// What is odd about the scale of a cloud whose particles have `volume` (one number for all where
/// the file has none), or "": the particles together are larger than ten cubes of its longest side,
/// or less than 1e-4 of its bounding box. Positions in millimetres beside volumes in cubic metres
/// are off by 1e9.
std::string odd_scale(const ParticleCloud& cloud, const std::vector<double>& volume);
/// The text form; `name` stands for the file in messages.
ParticleCloud parse_particles(const std::string& text, const std::string& name);

}  // namespace uniphy
