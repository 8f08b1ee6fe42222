#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "uniphy/io/observation.hpp"
#include "uniphy/io/trajectory.hpp"
#include "uniphy/report/plastic_strain.hpp"

namespace uniphy {

/// How particles moved, as a report plays it. Single precision: it is to be looked at.
struct Motion {
  std::string name;                   ///< "observed"
  std::int64_t particles = 0;         ///< that are kept
  std::vector<std::int32_t> body;     ///< [particles]
  std::vector<double> time;           ///< [frames] s
  std::vector<float> x;               ///< [frames, particles, 3] m, NaN where hidden
  std::vector<float> plastic_strain;  ///< [frames, particles] 1, or empty
  std::vector<float> error;           ///< [frames, particles] m to `reference`, or empty
  std::string reference;              ///< the name of the motion that the error is to
  bool cloud = false;  ///< row p of a frame is another point than that of the next: without speed
  std::int64_t frame_stride = 1;     ///< every so many frames of the run are kept
  std::int64_t particle_stride = 1;  ///< and every so many of its particles

  std::int64_t frames() const { return static_cast<std::int64_t>(time.size()); }
};

/// Most particles of a motion, and most particles times frames, that a report keeps in memory.
inline constexpr std::int64_t kMaximumParticles = 100'000;
inline constexpr std::int64_t kMaximumParticleFrames = 16'000'000;

/// Takes a motion frame by frame. Where the frames become too many, it drops every second one and
/// goes on with twice the stride.
class MotionRecorder {
 public:
  MotionRecorder(std::string name, const std::vector<std::int32_t>& body,
                 std::int64_t maximum_particles = kMaximumParticles,
                 std::int64_t maximum_particle_frames = kMaximumParticleFrames);
  /// `x` [particles, 3] m; `F` [particles, 3, 3], the elastic deformation gradient, for the plastic
  /// strain, or null; `reference` [particles, 3] m, for the error, or null: every frame the same.
  void add(double time, const double* x, const double* F, const double* reference);
  /// The motion; `reference` names what the error is to.
  Motion finish(const std::string& reference = "");

 private:
  void thin_out();

  Motion motion_;
  std::int64_t maximum_frames_;
  std::int64_t seen_ = 0;
  std::unique_ptr<PlasticStrain> strain_;
};

/// A whole trajectory, with the plastic strain where it holds F.
Motion motion_of(const std::string& name, const Trajectory& trajectory);
/// The same with the distance of every particle from where `reference` has it, of the same
/// particles and frames; without where they differ.
Motion motion_of(const std::string& name, const Trajectory& trajectory,
                 const std::string& reference_name, const Trajectory& reference);
/// The observed points, or clouds.
Motion motion_of(const std::string& name, const Observation& observation);

}  // namespace uniphy
