#include "uniphy/scene/simulation_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/observation.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/report/progress.hpp"
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
      "density and volumes of a single body, nothing about its law");
  output.gzip = static_cast<int>(
      section.integer("gzip", 0, between(0, 9), "", "compression of the trajectory, 0: none"));
  output.picture_frames =
      section.integer("picture_frames", 6, between(0, 60), "", "panels of frames.png, 0: none");
  return output;
}

void simulate_into(const SceneDescription& scene, const SimulationOutput& output, RunDirectory& out,
                   Metrics& metrics) {
  const PlacedScene placed = place_scene(scene);
  if (output.observation && scene.bodies.size() != 1) {
    throw Error(fmt::format("output.observation: expected a scene of one body, found {}",
                            scene.bodies.size()));
  }
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

  Observation seen = begin_observation(placed.grid, scene.bodies.front().density, placed.volume);
  const std::int64_t frames = placed.steps / scene.frame_stride + 1;
  ParticlePicture picture;
  picture.columns = static_cast<int>(std::min<std::int64_t>(output.picture_frames, 6));
  Progress progress("simulate", placed.steps);
  const auto start = std::chrono::steady_clock::now();
  const ParticleState last =
      run_scene(scene, placed, output.fields,
                [&](double time, std::int64_t step, const ParticleState& state) {
                  if (is_pictured(writer.frames(), frames, output.picture_frames)) {
                    ParticlePanel panel;
                    panel.caption = fmt::format("{:.3f} s", time);
                    panel.x = state.x;
                    if (scene.bodies.size() > 1)
                      panel.colour.assign(placed.body.begin(), placed.body.end());
                    picture.panels.push_back(std::move(panel));
                  }
                  writer.append(time, step, state);
                  if (output.observation) add_frame(seen, time, state.x);
                  progress.update(step);
                  return true;
                });
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  progress.finish();
  metrics.set("frames", static_cast<double>(writer.frames()));
  writer.finish(last);
  if (output.observation) write_observation(out.file("observation.h5"), seen);
  const double particle_steps =
      static_cast<double>(placed.particles()) * static_cast<double>(placed.steps);
  if (particle_steps > 0) metrics.set("ns_per_particle_step", 1e9 * seconds / particle_steps);
  if (!picture.panels.empty()) plot_particles(out.file("frames.png"), picture);
}

}  // namespace uniphy
