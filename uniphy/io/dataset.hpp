#pragma once

// dataset.h5: samples of the constitutive laws along many trajectories.
//
//   attributes  format = "uniphy-dataset", version = 1, config = YAML that generated it
//   /samples/F       [S, 3, 3]  1    trial deformation gradient
//   /samples/F_proj  [S, 3, 3]  1    projected deformation gradient G(F)
//   /samples/C       [S, 3, 3]  1/s  affine velocity
//   /samples/tau     [S, 3, 3]  Pa   Kirchhoff stress of (F_proj, C)
//   /samples/trajectory [S]     1    row of /trajectories, not decreasing
//   /samples/source     [S]     1    0: state of a simulation, 1: state drawn at random and put to
//                                    the law; a file without it holds simulated states only
//   /trajectories/material   [N]     name of the law; random_solid, random_fluid, random_plastic:
//                                    one drawn at random, whose numbers follow from the seed
//   /trajectories/parameters [N, 5]  mu (Pa), lambda (Pa), tau_y (Pa), theta (rad), eta (Pa s);
//                                    NaN where the law has none
//   /trajectories/dt [N] s, density [N] kg/m^3, seed [N], shape [N]
//   /trajectories/attempt [N]        which draw of the trajectory it is, counted from 0 (a run that
//                                    failed was replaced); a file without it holds first draws

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/material_parameters.hpp"

namespace uniphy {

struct TrajectoryRecord {
  std::string material;
  MaterialParameters parameters = no_parameters();
  double dt = 0;       ///< s
  double density = 0;  ///< kg/m^3
  std::int64_t seed = 0;
  std::int64_t attempt = 0;
  std::string shape;
};

/// Values of /samples/source.
inline constexpr std::int32_t kSimulatedSample = 0;
inline constexpr std::int32_t kDrawnSample = 1;

/// Samples of one or many trajectories; all arrays [samples, 3, 3], row-major.
struct LawSamples {
  std::vector<double> F;
  std::vector<double> F_proj;
  std::vector<double> C;
  std::vector<double> tau;
  std::vector<std::int32_t> source;  ///< [samples], or empty where all are simulated

  std::int64_t size() const { return static_cast<std::int64_t>(F.size() / 9); }
};

struct Dataset {
  std::vector<TrajectoryRecord> trajectories;  ///< [N]
  LawSamples samples;                          ///< [S], ordered by trajectory
  std::vector<std::int32_t> trajectory;        ///< [S] row of trajectories
  std::vector<std::int64_t> first;             ///< [N + 1] samples of i: first[i] ... first[i+1]-1
  std::string config;
};

/// Shortest and longest time step of its trajectories, s.
std::array<double, 2> time_steps(const Dataset& data);

/// Trajectory by trajectory, so that the memory holds one of them.
class DatasetWriter {
 public:
  explicit DatasetWriter(const std::filesystem::path& file, const std::string& config = "",
                         int gzip = 0);
  void append(const TrajectoryRecord& record, const LawSamples& samples);
  /// Writes the table of trajectories and names the file. Nothing is kept without it.
  void finish();
  std::int64_t samples() const { return samples_; }

 private:
  hdf5::Writer writer_;
  std::vector<TrajectoryRecord> records_;
  std::int64_t samples_ = 0;
};

/// Checks format, shapes, finite samples of a sensible size, the order of /samples/trajectory, and
/// that every trajectory has samples.
Dataset read_dataset(const std::filesystem::path& file);

}  // namespace uniphy
