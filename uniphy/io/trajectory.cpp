#include "uniphy/io/trajectory.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-trajectory";

/// One of the per-particle arrays: its name, the extents of one particle, what it is.
struct Field {
  const char* name;
  hdf5::Shape row;
  const char* units;
  const char* description;
  std::vector<double> ParticleState::*state;
  std::vector<double> Trajectory::*frames;  ///< null: in the last state alone
};

const std::vector<Field>& fields() {
  static const std::vector<Field> all{
      {"x", {3}, "m", "positions", &ParticleState::x, &Trajectory::x},
      {"v", {3}, "m/s", "velocities", &ParticleState::v, &Trajectory::v},
      {"C",
       {3, 3},
       "1/s",
       "affine velocity (velocity gradient)",
       &ParticleState::C,
       &Trajectory::C},
      {"F", {3, 3}, "1", "deformation gradient", &ParticleState::F, &Trajectory::F},
      {"memory", {}, "1", "memory of the law", &ParticleState::memory, nullptr},
  };
  return all;
}

bool stored(const Field& field, FrameFields which) {
  switch (field.name[0]) {
    case 'v':
      return which.v;
    case 'C':
      return which.C;
    case 'F':
      return which.F;
    case 'm':
      return false;
    default:
      return true;
  }
}

std::int64_t row_size(const Field& field) {
  std::int64_t size = 1;
  for (const std::int64_t extent : field.row) size *= extent;
  return size;
}

hdf5::Shape with_leading(std::vector<std::int64_t> leading, const hdf5::Shape& row) {
  leading.insert(leading.end(), row.begin(), row.end());
  return leading;
}

void check_size(const hdf5::Writer& writer, const char* name, std::size_t found,
                std::int64_t expected) {
  if (static_cast<std::int64_t>(found) != expected) {
    throw Error(fmt::format("{}: /{}: expected {} numbers, found {}", writer.file().string(), name,
                            expected, found));
  }
}

/// Of all that a run goes on from.
std::string checksum(const ParticleState& last, const RunPoint& end) {
  kernels::Hash hash;
  for (const Field& field : fields()) hash.add(last.*field.state);
  hash.add(end.sorted_x).add(fmt::format("{} {} {}", end.step, end.steps_sorted, end.scene_hash));
  return hash.text();
}

ParticleState read_last(const hdf5::Reader& reader, std::int64_t particles) {
  ParticleState last;
  for (const Field& field : fields()) {
    const std::string name = fmt::format("/final/{}", field.name);
    if (!reader.has(name)) continue;
    last.*field.state =
        reader.read<double>(name, with_leading({particles}, field.row), hdf5::Values::finite);
  }
  return last;
}

std::optional<RunPoint> read_end(const hdf5::Reader& reader, const ParticleState& last) {
  if (!reader.has("/final/sorted_x") || last.x.empty()) return {};
  RunPoint end;
  end.sorted_x = reader.read<double>(
      "/final/sorted_x", {static_cast<std::int64_t>(last.x.size() / 3), 3}, hdf5::Values::finite);
  end.step = reader.attribute_integer("/final", "step");
  end.steps_sorted = reader.attribute_integer("/final", "steps_sorted");
  end.scene_hash = reader.attribute_text("/final", "scene_hash");
  const std::string found = checksum(last, end);
  const std::string expected = reader.attribute_text("/final", "checksum");
  if (found != expected) {
    reader.fail("/final", fmt::format("expected the checksum {}, found {}; the file is damaged",
                                      expected, found));
  }
  return end;
}

}  // namespace

TrajectoryWriter::TrajectoryWriter(const std::filesystem::path& file,
                                   const TrajectoryHeader& header, FrameFields which, int gzip)
    : writer_(file), particles_(static_cast<std::int64_t>(header.body.size())), fields_(which) {
  if (particles_ == 0) {
    throw Error(fmt::format("{}: expected at least one particle, found none", file.string()));
  }
  check_size(writer_, "mass", header.mass.size(), particles_);
  check_size(writer_, "volume", header.volume.size(), particles_);
  writer_.attribute("/", "format", kFormat);
  writer_.attribute("/", "version", 1);
  writer_.attribute("/", "scene", header.scene);
  writer_.write("body", header.body, {particles_}, {"1", "index of the body in the scene", gzip});
  writer_.write("mass", header.mass, {particles_}, {"kg", "mass of each particle", gzip});
  writer_.write("volume", header.volume, {particles_},
                {"m^3", "volume of each particle at rest", gzip});
  writer_.extendible<double>("time", {}, {"s", "time of each frame"});
  writer_.extendible<std::int64_t>("step", {}, {"1", "MPM step of each frame"});
  for (const Field& field : fields()) {
    if (!stored(field, which)) continue;
    writer_.extendible<double>(field.name, with_leading({particles_}, field.row),
                               {field.units, field.description, gzip});
  }
}

void TrajectoryWriter::append(double time, std::int64_t step, const ParticleState& state) {
  if (!times_.empty() && (time <= times_.back() || step <= last_step_)) {
    throw Error(
        fmt::format("{}: /time: expected increasing times and steps, found {} s (step {}) "
                    "after {} s (step {})",
                    writer_.file().string(), time, step, times_.back(), last_step_));
  }
  for (const Field& field : fields()) {
    if (!stored(field, fields_)) continue;
    const std::vector<double>& data = state.*field.state;
    check_size(writer_, field.name, data.size(), particles_ * row_size(field));
    writer_.append(field.name, data.data(), 1);
  }
  writer_.append("time", &time, 1);
  writer_.append("step", &step, 1);
  times_.push_back(time);
  last_step_ = step;
}

void TrajectoryWriter::finish(const ParticleState& last, const RunPoint* end) {
  for (const Field& field : fields()) {
    const std::vector<double>& data = last.*field.state;
    if (data.empty()) continue;
    check_size(writer_, field.name, data.size(), particles_ * row_size(field));
    writer_.write(fmt::format("final/{}", field.name), data, with_leading({particles_}, field.row),
                  {field.units, fmt::format("last state: {}", field.description)});
  }
  if (end != nullptr) {
    check_size(writer_, "final/sorted_x", end->sorted_x.size(), 3 * particles_);
    writer_.write("final/sorted_x", end->sorted_x, {particles_, 3},
                  {"m", "positions by which the particles were last sorted"});
    writer_.attribute("final", "step", end->step);
    writer_.attribute("final", "steps_sorted", end->steps_sorted);
    writer_.attribute("final", "scene_hash", end->scene_hash);
    writer_.attribute("final", "checksum", checksum(last, *end));
  }
  writer_.attribute("/", "complete", 1);
  commit();
}

void TrajectoryWriter::finish_incomplete(const std::string& failure) {
  writer_.attribute("/", "complete", 0);
  writer_.attribute("/", "error", failure);
  commit();
}

void TrajectoryWriter::commit() {
  for (std::size_t frame = 0; frame < times_.size(); ++frame) {
    for (const Field& field : fields()) {
      if (!stored(field, fields_)) continue;
      writer_.row_view(xdmf_view(frame, field.name), field.name, static_cast<std::int64_t>(frame));
    }
  }
  std::vector<std::int32_t> vertices(static_cast<std::size_t>(particles_));
  std::iota(vertices.begin(), vertices.end(), 0);
  writer_.write(kXdmfVertices, vertices, {particles_}, {"1", "points that ParaView draws"});
  const std::filesystem::path file = writer_.file();
  writer_.commit();
  auto xdmf = file;
  xdmf.replace_extension(".xdmf");
  write_text_file(xdmf, xdmf_text(file.filename().string(), particles_, times_, fields_));
}

void write_trajectory(const std::filesystem::path& file, const Trajectory& trajectory) {
  const FrameFields which{!trajectory.v.empty(), !trajectory.C.empty(), !trajectory.F.empty()};
  TrajectoryWriter writer(file, trajectory, which);
  const std::int64_t particles = trajectory.particles;
  for (std::int64_t frame = 0; frame < trajectory.frames; ++frame) {
    ParticleState state;
    for (const Field& field : fields()) {
      if (!stored(field, which)) continue;
      const std::vector<double>& all = trajectory.*field.frames;
      const std::int64_t size = particles * row_size(field);
      if (static_cast<std::int64_t>(all.size()) != trajectory.frames * size) {
        throw Error(fmt::format("{}: /{}: expected {} numbers, found {}", file.string(), field.name,
                                trajectory.frames * size, all.size()));
      }
      (state.*field.state).assign(all.begin() + frame * size, all.begin() + (frame + 1) * size);
    }
    const auto at = static_cast<std::size_t>(frame);
    writer.append(trajectory.time.at(at), trajectory.step.at(at), state);
  }
  if (trajectory.failure.empty()) {
    writer.finish(trajectory.last, trajectory.end ? &*trajectory.end : nullptr);
  } else {
    writer.finish_incomplete(trajectory.failure);
  }
}

bool is_trajectory(const hdf5::Reader& reader) {
  return reader.has_attribute("/", "format") && reader.attribute_text("/", "format") == kFormat;
}

std::string trajectory_failure(const hdf5::Reader& reader) {
  // Files of older versions have no such attribute; theirs are complete.
  if (!reader.has_attribute("/", "complete") || reader.attribute_integer("/", "complete") != 0) {
    return "";
  }
  const std::string failure = reader.attribute_text("/", "error");
  return failure.empty() ? "unknown" : failure;
}

Trajectory read_trajectory(const std::filesystem::path& file, bool positions_only) {
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
  Trajectory trajectory;
  trajectory.x = reader.read<double>("x", {-1, -1, 3}, hdf5::Values::finite);
  const hdf5::Shape shape = reader.shape("x");
  trajectory.frames = shape[0];
  trajectory.particles = shape[1];
  if (trajectory.frames == 0 || trajectory.particles == 0) {
    reader.fail("/x",
                fmt::format("expected at least one frame and one particle, found the shape {}",
                            hdf5::shape_text(shape)));
  }
  trajectory.time = reader.read<double>("time", {trajectory.frames}, hdf5::Values::finite);
  trajectory.step = reader.read<std::int64_t>("step", {trajectory.frames});
  for (std::size_t i = 1; i < trajectory.time.size(); ++i) {
    if (trajectory.time[i] <= trajectory.time[i - 1]) {
      reader.fail("/time", fmt::format("expected increasing times, found {} s after {} s",
                                       trajectory.time[i], trajectory.time[i - 1]));
    }
  }
  trajectory.body = reader.read<std::int32_t>("body", {trajectory.particles});
  trajectory.mass = reader.read<double>("mass", {trajectory.particles}, hdf5::Values::finite);
  trajectory.volume = reader.read<double>("volume", {trajectory.particles}, hdf5::Values::finite);
  trajectory.scene = reader.attribute_text("/", "scene");
  trajectory.failure = trajectory_failure(reader);
  if (positions_only) return trajectory;
  for (const Field& field : fields()) {
    if (field.name[0] != 'x' && field.frames != nullptr && reader.has(field.name)) {
      trajectory.*field.frames = reader.read<double>(
          field.name, with_leading({trajectory.frames, trajectory.particles}, field.row),
          hdf5::Values::finite);
    }
  }
  trajectory.last = read_last(reader, trajectory.particles);
  trajectory.end = read_end(reader, trajectory.last);
  return trajectory;
}

RunState read_run_state(const std::filesystem::path& file) {
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
  const std::string failure = trajectory_failure(reader);
  if (!failure.empty()) {
    throw Error(fmt::format("{}: expected a complete trajectory, found one whose run failed: {}",
                            file.string(), failure));
  }
  RunState state;
  state.particles = read_last(reader, reader.shape("/mass").at(0));
  const auto end = read_end(reader, state.particles);
  if (!end) {
    reader.fail("/final",
                "expected a last state that a run can go on from, found none; the file was not "
                "written by a simulation of a scene, or by an older version");
  }
  state.point = *end;
  state.scene = reader.attribute_text("/", "scene");
  return state;
}

}  // namespace uniphy
