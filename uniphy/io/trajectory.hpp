#pragma once

// trajectory.h5: how an object moved.
//
//   attributes  format = "uniphy-trajectory", version = 1, scene = YAML of the scene;
//               complete = 1, or 0 where the run ended before its time: then error says why, the
//               frames until then are there, and /final is not
//   /x      [frames, particles, 3]     m     positions
//   /time   [frames]                   s
//   /step   [frames]                   1     index of the MPM step
//   /v      [frames, particles, 3]     m/s   optional
//   /C      [frames, particles, 3, 3]  1/s   optional, affine velocity
//   /F      [frames, particles, 3, 3]  1     optional, deformation gradient
//   /body   [particles]                1     index of the body in the scene
//   /mass   [particles]                kg
//   /volume [particles]                m^3   volume at rest
//   /final/{x,v,C,F}                         the last state
//   /final/memory [particles]          1     memory of the laws, where a body's law has one
//   /final/sorted_x [particles, 3]     m     positions by which the particles were last sorted
//   attributes of /final, where a simulation of a scene wrote it: step = its MPM step, steps_sorted
//               = steps since then, scene_hash = of masses, volumes and laws, checksum = of the
//               state. From such a file a run goes on to the bits of an uninterrupted one
//               (scene.continue); without them, the last state is only to be looked at.
//   /xdmf/K/{x,v,C,F}                        frame K of each of the above; views without data
//   /xdmf/vertex [particles]           1     0, 1, 2, ...
//
// Numbers are float64, indices int32 (body, vertex) and int64 (step). Every dataset but the views
// has the attributes `units` and `description`. The XDMF file beside it opens the trajectory in
// ParaView, with any of its three readers: these agree on whole datasets alone, and two of them
// draw a point only where the topology lists it; so /xdmf has a view of every frame, and a list.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ops/kernels/mpm/particle_state.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {

using ParticleState = kernels::ParticleState<double>;

/// What does not change along a trajectory.
struct TrajectoryHeader {
  std::vector<std::int32_t> body;  ///< [particles]
  std::vector<double> mass;        ///< [particles] kg
  std::vector<double> volume;      ///< [particles] m^3
  std::string scene;               ///< YAML
};

/// What a run needs besides the last particles to go on to the bits of an uninterrupted one.
struct RunPoint {
  std::int64_t step = 0;          ///< steps that lead to the state
  std::int64_t steps_sorted = 0;  ///< since the particles were sorted (kernels::SortState)
  std::vector<double> sorted_x;   ///< [particles, 3] m, where they were then
  std::string scene_hash;         ///< of the scene that the state belongs to
};

/// Which optional fields every frame stores.
struct FrameFields {
  bool v = false;
  bool C = false;
  bool F = false;
};

struct Trajectory : TrajectoryHeader {
  std::int64_t frames = 0;
  std::int64_t particles = 0;
  std::vector<double> time;        ///< [frames] s
  std::vector<std::int64_t> step;  ///< [frames]
  std::vector<double> x;           ///< [frames, particles, 3] m
  std::vector<double> v;           ///< [frames, particles, 3] or empty
  std::vector<double> C;           ///< [frames, particles, 3, 3] or empty
  std::vector<double> F;           ///< [frames, particles, 3, 3] or empty
  ParticleState last;              ///< /final, empty arrays where absent
  std::optional<RunPoint> end;     ///< where the run stood in `last`
  std::string failure;             ///< why the run ended before its time; empty: it did not

  const double* positions(std::int64_t frame) const { return x.data() + frame * particles * 3; }
};

/// Frame by frame, so that a trajectory longer than the memory can be written.
class TrajectoryWriter {
 public:
  /// header.body sets the number of particles.
  TrajectoryWriter(const std::filesystem::path& file, const TrajectoryHeader& header,
                   FrameFields fields = {}, int gzip = 0);
  /// state.x and the declared fields must be there. Times and steps must increase.
  void append(double time, std::int64_t step, const ParticleState& state);
  /// Writes /final, names the file, writes the XDMF beside it. Nothing is kept without this or:
  /// `end` (null: none): what lets a run go on from `last`.
  void finish(const ParticleState& last, const RunPoint* end = nullptr);
  /// The same for a run that failed, without a last state: `failure` says why.
  void finish_incomplete(const std::string& failure);
  std::int64_t frames() const { return static_cast<std::int64_t>(times_.size()); }
  /// s, of the last frame, of which there must be one.
  double last_time() const { return times_.back(); }

 private:
  void commit();

  hdf5::Writer writer_;
  std::int64_t particles_;
  FrameFields fields_;
  std::vector<double> times_;
  std::int64_t last_step_ = 0;
};

void write_trajectory(const std::filesystem::path& file, const Trajectory& trajectory);

/// Checks format, shapes, finite positions, increasing times; an incomplete file is read, too. With
/// `positions_only` v, C, F and /final stay empty. Throws Error.
Trajectory read_trajectory(const std::filesystem::path& file, bool positions_only = false);

/// A state from which a run goes on, and the scene (YAML) that it is of.
struct RunState {
  ParticleState particles;
  RunPoint point;
  std::string scene;
};
/// The last state of a trajectory, without its frames. Throws Error where the file is incomplete,
/// holds none to go on from, or was damaged.
RunState read_run_state(const std::filesystem::path& file);

/// Whether an open file is a trajectory, whatever else may be wrong with it.
bool is_trajectory(const hdf5::Reader& reader);
/// Why the run behind an open trajectory ended before its time; empty: it did not.
std::string trajectory_failure(const hdf5::Reader& reader);

/// "xdmf/12/x": the view of one frame of a field, and the list of points.
std::string xdmf_view(std::size_t frame, const std::string& field);
constexpr const char* kXdmfVertices = "xdmf/vertex";
/// The XDMF text for a trajectory file (relative name `h5_name`) with these frames and fields.
std::string xdmf_text(const std::string& h5_name, std::int64_t particles,
                      const std::vector<double>& times, FrameFields fields);

}  // namespace uniphy
