#include "uniphy/evaluation/materials_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/evaluation/finished_fits.hpp"
#include "uniphy/evaluation/materials_table.hpp"
#include "uniphy/evaluation/open_world_cases.hpp"
#include "uniphy/evaluation/outside_scenes.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

struct MaterialsOptions {
  FitVariablesSource learned;
  GenerateOptions draw;
  std::vector<OpenWorldCase> cases;
  double noise = 0.005;
  std::int64_t frame_stride = 10;
  FitOptions fit;
  AdaptationOptions adaptation;
};

/// A motion that can be observed, and what made it.
struct DrawnMotion {
  std::string object;
  Observation whole;
  MaterialReading truth;
};

MaterialsOptions read_options(Section& config) {
  MaterialsOptions o;
  const bool quick = config.boolean("quick", false, "minutes: an object a material, half as long");
  GenerateOptions& draw = o.draw;
  draw.seed = static_cast<std::uint64_t>(config.integer(
      "seed", 1, between(0, 9e15), "", "of the objects, the noise and the tracked points"));
  o.learned.model = config.input_file("model", "models/pretrained/unified.h5", "the trained law");
  std::vector<std::string> families;
  for (const MaterialRanges& m : default_material_ranges()) families.push_back(m.name());
  const auto materials = config.choices("materials", families, families, "what moves", at_least(1));
  draw.materials.clear();
  for (const MaterialRanges& m : default_material_ranges()) {
    if (std::find(materials.begin(), materials.end(), m.name()) != materials.end())
      draw.materials.push_back(m);
  }
  std::vector<std::string> offered;  // a finer truth is of a cube alone
  for (const char* name : kOpenWorldCases) {
    if (name != std::string(case_name(OpenWorldCase::finer))) offered.push_back(name);
  }
  for (const std::string& name :
       config.choices("cases", std::vector<std::string>{"closed", "noise"}, offered,
                      "how they are observed, as in open_world", at_least(1))) {
    const auto* const at = std::find(std::begin(kOpenWorldCases), std::end(kOpenWorldCases), name);
    o.cases.push_back(static_cast<OpenWorldCase>(at - std::begin(kOpenWorldCases)));
  }
  o.noise = config.real("noise", 0.005, between(0, 0.2), "",
                        "standard deviation of a coordinate over the size of the object");
  Section objects = config.section("objects", "drawn as those of a held-out set");
  draw.split = Split::heldout_all;
  draw.trajectories = objects.integer("count", quick ? 1 : 10, between(1, 10000), "", "a material");
  draw.steps = objects.integer("steps", quick ? 750 : 1500, between(20, 1000000), "", "observed");
  draw.dt = objects.real("dt", *draw.dt, between(1e-6, 1e-2), "s", "time step");
  draw.particles = objects.integer("particles", 300, between(27, 100000), "", "about, of each");
  o.frame_stride = objects.integer("frame_stride", 10, between(1, 1000), "", "steps a frame");
  draw.heldout_shapes = {"blobby", "dodecahedron", "gear", "knurling",
                         "pawn",   "rounded_cone", "toy"};
  draw.size = {0.22, 0.32};
  draw.speed = {1, 4};  // as the hidden objects of uniphy_identify: they meet a wall at once
  draw.gap = {0.01, 0.06};
  draw.angular_speed = {0, 8};
  Section fit = config.section("fit", "as in uniphy_infer");
  o.fit = read_fit_options(fit);
  o.adaptation = read_adaptation_options(config);
  return o;
}

/// The truth is read off the true law at the strains that the motion reached: a body that never
/// yielded shows nothing of its yield stress.
DrawnMotion draw_motion(const MaterialsOptions& o, std::int64_t trajectory) {
  for (std::int64_t attempt = 0;; ++attempt) {
    const TrajectorySetup setup = draw_setup(o.draw, trajectory, attempt);
    DrawnMotion motion;
    motion.object =
        fmt::format("{}_{}", setup.record.material, trajectory % o.draw.trajectories + 1);
    OutsideScene scene{motion.object, setup.scene};
    scene.scene.frame_stride = o.frame_stride;
    try {
      motion.whole = observe(scene, setup.law());
      const ObservedSteps steps = observed_steps(motion.whole, motion.object);
      const kernels::GridSettings grid = observed_grid(motion.whole, motion.object);
      const BodyDescription& body = setup.scene.bodies.front();
      const InitialState start(
          RigidMotion{centre_of_mass(motion.whole), body.velocity, body.angular_velocity});
      const auto F = make_motion_objective(motion.whole, steps, grid, "float64")
                         ->deformations(setup.law(), start, motion.whole.frames);
      const double duration = motion.whole.time.back() - motion.whole.time.front();
      motion.truth = read_material(setup.law(), grid.dt, strain_seen(F), duration);
      motion.truth.cohesion = MaterialReading::kNone;  // of none of the families
      return motion;
    } catch (const Error&) {
      if (attempt + 1 >= o.draw.attempts) throw;
    }
  }
}

/// What uniphy_infer would write into metrics.json; empty where it fails.
Metrics fitted(const Observation& seen, const std::string& name, const FitVariables& variables,
               const MaterialsOptions& o, const std::filesystem::path& stem) {
  if (const auto before = FinishedFits::read(stem)) return *before;
  const auto start = std::chrono::steady_clock::now();
  Metrics found;
  try {
    const Inference inference =
        infer(seen, name, variables, o.fit, FinishedFits::hooks(stem), o.adaptation);
    add_metrics(found, inference, seen, variables);
  } catch (const Error& error) {
    std::fprintf(stderr, "warning: %s: %s\n", name.c_str(), error.what());
    found.set("failed", 1);
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  found.set("seconds", seconds.count());
  FinishedFits::write(stem, found);
  return found;
}

std::string named_material(const Metrics& found) {
  for (const MaterialRanges& family : default_material_ranges()) {
    if (found.find("material." + family.name())) return family.name();
  }
  return {};
}

void run(const MaterialsOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const auto variables = o.learned.load();
  const FinishedFits finished(out);
  const std::int64_t objects = o.draw.simulated();
  const std::size_t fits = static_cast<std::size_t>(objects) * o.cases.size();
  std::vector<MaterialRow> rows;
  std::vector<double> seconds;
  std::size_t failed = 0;
  // One object of each material, then the next of each, so that a table grows evenly.
  for (std::int64_t k = 0; k < objects; ++k) {
    const auto materials = static_cast<std::int64_t>(o.draw.materials.size());
    const std::int64_t trajectory = k % materials * o.draw.trajectories + k / materials;
    const DrawnMotion motion = draw_motion(o, trajectory);
    for (const OpenWorldCase c : o.cases) {
      MaterialRow row{case_name(c), motion.object, motion.truth, "", {}};
      std::fprintf(stderr, "%s, %s (%zu of %zu)\n", row.object.c_str(), row.observed.c_str(),
                   rows.size() + 1, fits);
      const Observation seen = seen_in(c, motion.whole, o.noise, o.draw.seed + 1000 * k);
      const std::string name = fmt::format("{}.{}", row.object, row.observed);
      row.found = fitted(seen, name, *variables, o, finished.stem(name, seen, *variables));
      row.material = named_material(row.found);
      failed += row.found.find("failed") ? 1 : 0;
      seconds.push_back(row.found.find("seconds").value_or(0));
      rows.push_back(std::move(row));
      out.write_table("materials.md", "Materials", materials_table(rows));
      write_text_file(out.file("materials.csv"), materials_csv(rows));
    }
  }
  add_materials_metrics(rows, metrics);
  metrics.set("fits", static_cast<double>(rows.size()));
  metrics.set("fits_failed", static_cast<double>(failed));
  metrics.set("seconds_a_fit", kernels::median(seconds));
  std::fputs(materials_table(rows).c_str(), stdout);
}

}  // namespace

RunFunction materials_stage(Section& config) {
  const MaterialsOptions o = read_options(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy
