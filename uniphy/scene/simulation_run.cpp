#include "uniphy/scene/simulation_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/io/plain_name.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/report/progress.hpp"
#include "uniphy/scene/continued_run.hpp"
#include "uniphy/scene/scene_warnings.hpp"

namespace uniphy {
namespace {

// Which frames the picture shows: evenly spread, first and last included.
bool is_pictured(std::int64_t frame, std::int64_t frames, std::int64_t panels) {
  for (std::int64_t k = 0; k < panels; ++k) {
    if (frame == (panels == 1 ? 0 : k * (frames - 1) / (panels - 1))) return true;
  }
  return false;
}

void record_metrics(const SceneDescription& scene, const PlacedScene& placed, Metrics& metrics) {
  metrics.set("dt", placed.grid.dt);
  metrics.set("stable_dt", placed.stable_dt);
  metrics.set("steps", static_cast<double>(placed.steps));
  metrics.set("simulated_s", static_cast<double>(placed.steps) * placed.grid.dt);
  metrics.set("particles", static_cast<double>(placed.particles()));
  metrics.set("mass", std::accumulate(placed.mass.begin(), placed.mass.end(), 0.0));
  const std::vector<double> per_cell = particles_per_cell(placed);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    std::string name = scene.bodies[b].name;
    std::replace_if(
        name.begin(), name.end(), [](char c) { return c <= ' ' || c == '"'; }, '_');
    const auto first = placed.volume.begin() + placed.first[b];
    const auto last = placed.volume.begin() + placed.first[b + 1];
    metrics.set("particles." + name, static_cast<double>(last - first));
    metrics.set("particles_per_cell." + name, per_cell[b]);
    metrics.set("volume." + name, std::accumulate(first, last, 0.0));
  }
}

void go_on(const SceneDescription& scene, const SimulationOutput& output, const RunDirectory& out,
           PlacedScene* placed) {
  std::error_code ignored;
  if (std::filesystem::equivalent(scene.continued, out.file("trajectory.h5"), ignored)) {
    throw Error(fmt::format(
        "scene.continue: expected a trajectory that this run does not replace, found {}; another "
        "--out keeps both",
        scene.continued.string()));
  }
  if (output.observation) {
    throw Error(
        "output.observation: expected a run from its start, for the first frame of an observation "
        "is taken as undeformed, found scene.continue");
  }
  continue_run(scene.continued, out.config_yaml(), scene, placed);
}

/// Draws frames of a trajectory, evenly spread, its first and last one included.
void draw_frames(const std::filesystem::path& png, const std::filesystem::path& trajectory,
                 const SimulationOutput& output) {
  if (output.picture_frames == 0) return;
  const hdf5::Reader reader(trajectory);
  const hdf5::Shape shape = reader.shape("x");
  const auto time = reader.read<double>("time", {shape[0]});
  const auto body = reader.read<std::int32_t>("body", {shape[1]});
  ParticlePicture picture;
  picture.columns = static_cast<int>(std::min<std::int64_t>(output.picture_frames, 6));
  // Several bodies are told apart; of one, colours follow the particles.
  const bool several = body.back() > 0;
  std::vector<double> colour(body.begin(), body.end());
  if (!several) {
    const auto first = reader.read_rows<double>("x", {-1, shape[1], 3}, 0, 1);
    colour = heights_in_body(first);
    picture.colour_label = kHeightInBody;
  }
  if (!trajectory_failure(reader).empty()) picture.title = "incomplete";
  for (std::int64_t frame = 0; frame < shape[0]; ++frame) {
    if (!is_pictured(frame, shape[0], output.picture_frames)) continue;
    ParticlePanel panel;
    panel.caption = fmt::format("{:.3f} s", time[static_cast<std::size_t>(frame)]);
    panel.x = reader.read_rows<double>("x", {-1, shape[1], 3}, frame, 1);
    panel.colour = colour;
    picture.panels.push_back(std::move(panel));
  }
  plot_particles(png, picture);
}

/// What uniphy_infer may see of the bodies.
class SeenBodies {
 public:
  SeenBodies(const SceneDescription& scene, const PlacedScene& placed) : first_(placed.first) {
    const bool several = scene.bodies.size() > 1;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
      const BodyDescription& body = scene.bodies[b];
      if (several && !is_plain_name(body.name)) {
        throw Error(
            fmt::format("output.observation: bodies.{}.name: expected letters, digits, _, - and . "
                        "(no dot first), found \"{}\"",
                        b, body.name));
      }
      const auto volume = placed.volume.begin();
      bodies_.push_back({several ? body.name : "",
                         begin_observation(placed.grid, body.density,
                                           {volume + first_[b], volume + first_[b + 1]})});
    }
  }
  void add(double time, const std::vector<double>& x) {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      add_frame(bodies_[b].motion, time,
                {x.begin() + 3 * first_[b], x.begin() + 3 * first_[b + 1]});
    }
  }
  void write(const std::filesystem::path& file) const { write_observed_bodies(file, bodies_); }

 private:
  std::vector<std::ptrdiff_t> first_;
  std::vector<ObservedBody> bodies_;
};

/// Takes the motion for the report, where there is one.
class ReportedMotion {
 public:
  ReportedMotion(const SceneDescription& scene, const PlacedScene& placed, const RunDirectory& out)
      : report_(out.report()) {
    if (report_ == nullptr) return;
    recorder_.emplace("simulated", placed.body);
    playback_.title = "Simulation";
    for (const BodyDescription& body : scene.bodies) playback_.bodies.push_back(body.name);
    playback_.low = placed.grid.bound * placed.grid.dx();
    playback_.high = 1 - playback_.low;
  }
  /// The fields of a frame, with what the report needs.
  FrameFields fields(FrameFields fields) const {
    fields.F = fields.F || report_ != nullptr;
    return fields;
  }
  void add(double time, const ParticleState& state) {
    if (recorder_) recorder_->add(time, state.x.data(), state.F.data(), nullptr);
  }
  /// The frames that there are: all of them, or those before a failure.
  void show() {
    if (!recorder_) return;
    playback_.motions.push_back(recorder_->finish());
    report_->playbacks.push_back(std::move(playback_));
  }

 private:
  Report* report_;
  std::optional<MotionRecorder> recorder_;
  Playback playback_;
};

/// What a run that failed has computed is all that shows why. Throws nothing: the failure itself is
/// what the user has to hear of last.
void keep_frames(TrajectoryWriter& writer, const std::string& failure,
                 const SimulationOutput& output, const RunDirectory& out) {
  const std::filesystem::path file = out.file("trajectory.h5");
  try {
    writer.finish_incomplete(failure);
    // That of an earlier run would pass for one of this.
    if (output.observation) std::filesystem::remove(out.file("observation.h5"));
    fmt::print(stderr, "warning: {}: keeps the frames up to {:.6g} s, marked as incomplete\n",
               file.string(), writer.last_time());
    draw_frames(out.file("frames.png"), file, output);
  } catch (const std::exception& error) {
    fmt::print(stderr, "warning: not all of the frames could be kept: {}\n", error.what());
  }
}

}  // namespace

SimulationOutput read_simulation_output(Section& config) {
  Section section = config.section("output", "what is stored");
  SimulationOutput output;
  for (const std::string& field :
       section.choices("fields", std::vector<std::string>(), {"v", "C", "F"},
                       "stored with every frame besides the positions")) {
    if (field == "v") output.fields.v = true;
    if (field == "C") output.fields.C = true;
    if (field == "F") output.fields.F = true;
  }
  output.observation = section.boolean(
      "observation", false,
      "also observation.h5, all that uniphy_infer may see: positions, times, walls, "
      "density and volumes of the bodies, nothing about their laws");
  output.gzip = static_cast<int>(
      section.integer("gzip", 0, between(0, 9), "", "compression of the trajectory, 0: none"));
  output.picture_frames =
      section.integer("picture_frames", 6, between(0, 60), "", "panels of frames.png, 0: none");
  return output;
}

void simulate_into(const SceneDescription& scene, const SimulationOutput& output, RunDirectory& out,
                   Metrics& metrics) {
  PlacedScene placed = place_scene(scene);
  if (!scene.continued.empty()) {
    go_on(scene, output, out, &placed);
    metrics.set("first_step", static_cast<double>(placed.start->point.step));
  }
  std::optional<SeenBodies> seen;
  if (output.observation) seen.emplace(scene, placed);
  record_metrics(scene, placed, metrics);
  for (const std::string& warning : scene_warnings(scene, placed)) {
    fmt::print(stderr, "warning: {}\n", warning);
  }

  TrajectoryHeader header;
  header.body = placed.body;
  header.mass = placed.mass;
  header.volume = placed.volume;
  header.scene = out.config_yaml();
  TrajectoryWriter writer(out.file("trajectory.h5"), header, output.fields, output.gzip);

  const std::int64_t first = placed.start ? placed.start->point.step : 0;
  ReportedMotion reported(scene, placed, out);
  Progress progress("simulate", placed.steps);
  const auto start = std::chrono::steady_clock::now();
  ParticleState last;
  RunPoint end;
  bool storing = false;  // what fails while a frame is written may leave a part of it
  try {
    last = run_scene(
        scene, placed, reported.fields(output.fields),
        [&](double time, std::int64_t step, const ParticleState& state) {
          storing = true;
          writer.append(time, step, state);
          storing = false;
          if (seen) seen->add(time, state.x);
          reported.add(time, state);
          progress.update(step - first);
          return true;
        },
        &end);
  } catch (const std::exception& error) {
    progress.finish();
    reported.show();
    if (!storing && writer.frames() > 0) keep_frames(writer, error.what(), output, out);
    throw;
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  progress.finish();
  metrics.set("frames", static_cast<double>(writer.frames()));
  writer.finish(last, &end);
  if (seen) seen->write(out.file("observation.h5"));
  const double particle_steps =
      static_cast<double>(placed.particles()) * static_cast<double>(placed.steps);
  if (particle_steps > 0) metrics.set("ns_per_particle_step", 1e9 * seconds / particle_steps);
  draw_frames(out.file("frames.png"), out.file("trajectory.h5"), output);
  reported.show();
  fmt::print("{} particles, {} steps of {:.4g} s, {} frame{}\n", placed.particles(), placed.steps,
             placed.grid.dt, writer.frames(), writer.frames() == 1 ? "" : "s");
}

}  // namespace uniphy
