#include "uniphy/data/generate_options.hpp"

#include <fmt/format.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/random_row.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/scene/law_config.hpp"

namespace uniphy {
namespace {

using kernels::LawId;

void read_materials(Section& config, GenerateOptions& options) {
  std::vector<std::string> names;
  for (const MaterialRanges& ranges : default_material_ranges()) names.push_back(ranges.name());
  const std::vector<std::string> chosen =
      config.choices("materials", names, names, "materials of the data set", at_least(1));

  Section all = config.section("ranges", "parameters are drawn log-uniformly, theta uniformly");
  std::vector<MaterialRanges> read;
  for (MaterialRanges ranges : default_material_ranges()) {
    Section section = all.section(ranges.name(), "");
    for (const kernels::LawParameter& p : kernels::law_parameters(ranges.id)) {
      Range range = range_of(p);
      range.low_open = true;  // they are drawn as logarithms
      auto& interval = ranges.interval[static_cast<std::size_t>(p.place)];
      interval = section.interval(p.name, interval, range, p.unit, p.text);
    }
    read.push_back(ranges);
  }
  options.materials.clear();
  for (const std::string& name : chosen) {
    for (const MaterialRanges& ranges : read) {
      if (ranges.name() == name) options.materials.push_back(ranges);
    }
  }
}

void read_simulation(Section& config, GenerateOptions& o) {
  Section s = config.section("simulation", "the same for all trajectories");
  o.grid.n = static_cast<int>(s.integer("grid", 20, between(10, 256), "", "nodes a side"));
  o.grid.bound =
      static_cast<int>(s.integer("bound", 3, between(2, 32), "", "thickness of the walls, nodes"));
  if (4 * o.grid.bound > o.grid.n + 2 && !s.describing()) {
    s.fail("bound", fmt::format("expected walls that leave half of the grid free, found {} of {} "
                                "nodes on each side",
                                o.grid.bound, o.grid.n));
  }
  const std::string wall =
      s.choice("wall", "freeslip", {"freeslip", "noslip"}, "what the walls do");
  o.grid.wall = wall == "noslip" ? kernels::Wall::noslip : kernels::Wall::freeslip;
  const auto gravity = s.vector3("gravity", std::array<double, 3>{0, -9.8, 0}, between(-100, 100),
                                 "m/s^2", "acceleration");
  for (std::size_t i = 0; i < 3; ++i) o.grid.gravity[i] = gravity[i];
  o.steps = s.integer("steps", 2000, between(10, 1000000), "", "steps of every trajectory");
  o.dt = s.real_or("auto", "dt", std::optional<double>(1.0 / 4800), between(1e-7, 1e-2), "s",
                   "time step; auto: from stiffness and viscosity. The law of non_newtonian holds "
                   "it, so a learned law is right for the step of its data set. A fixed step is "
                   "lowered for single trajectories that would not be stable");
  o.particles = s.integer("particles", 500, between(8, 1000000), "",
                          "about so many in a body (a lattice cannot meet every number)");
  o.density = s.real("density", 1000, between(1, 1e5), "kg/m^3", "mass density");
}

void read_bodies(Section& config, GenerateOptions& o) {
  Section s = config.section("body", "one body a trajectory");
  o.shapes =
      s.choices("shapes",
                std::vector<std::string>{"box", "capped_cone", "cylinder", "ellipsoid",
                                         "octahedron", "pyramid", "rounded_box", "sphere", "torus"},
                shape_names(), "shapes of train and heldout_materials", at_least(1));
  o.heldout_shapes = s.choices("heldout_shapes",
                               std::vector<std::string>{"blobby", "dodecahedron", "gear",
                                                        "knurling", "pawn", "rounded_cone", "toy"},
                               shape_names(), "shapes of heldout_all", at_least(1));
  o.size = s.interval("size", o.size, between(0.01, 0.6), "m", "largest side before the rotation");
  const double room = 1 - 2 * o.grid.bound * o.grid.dx(), diagonal = std::sqrt(3.0) * o.size[1];
  if (diagonal > 0.95 * room && !s.describing()) {
    s.fail("size",
           fmt::format("expected bodies that fit between the walls when turned (up to {:.3g} "
                       "m), found {:.3g} m",
                       0.95 * room / std::sqrt(3.0), o.size[1]));
  }

  Section m = config.section("motion", "where bodies start and how they move");
  o.motions = m.choices("kinds", o.motions, o.motions,
                        "falling, left, right, diagonal (towards an edge of the floor), random",
                        at_least(1));
  o.speed = m.interval("speed", o.speed, between(0.01, 50), "m/s",
                       "log-uniform where the material does not yield");
  o.impact_over_yield =
      m.interval("impact_over_yield", o.impact_over_yield, between(0.01, 1000), "",
                 "where it can yield: strain of the impact (speed over wave speed) over the yield "
                 "strain, log-uniform; the speed stays within `speed`");
  o.gap = m.interval("gap", o.gap, between(0, 0.5), "m",
                     "distance to the walls ahead (falling: drop height); less for slow bodies, so "
                     "that all of them arrive");
  o.angular_speed = m.interval("angular_speed", o.angular_speed, between(0, 200), "rad/s",
                               "about a random axis, for every second body");
}

void read_samples(Section& config, GenerateOptions& o) {
  Section s = config.section("samples", "what is kept of a trajectory");
  o.samples = s.integer("per_trajectory", 1000, between(10, 1000000), "", "number of samples");
  o.every = s.integer("every", 10, between(1, 100000), "", "steps between two looks");
  if (o.every > o.steps && !s.describing()) {
    s.fail("every", fmt::format("expected at most the {} steps of a trajectory, found {}", o.steps,
                                o.every));
  }
  o.uniform_share = s.real("uniform_share", 0.25, between(0, 1), "",
                           "part of the simulated samples taken as they come; the others are "
                           "spread over branches of the law, strains and rates");
  Section d = s.section("drawn",
                        "states drawn at random and put to the analytic law, for branches "
                        "and strains that the trajectory does not reach");
  o.drawn_share = d.real("share", 0.25, between(0, 1), "", "part of the samples");
  o.drawn_step = d.real("step", 0.01, between(1e-5, 1), "",
                        "largest step of a trial strain past the yield surface");
  o.drawn_strain = d.real("strain", 0.5, between(0.001, 1), "", "largest Hencky strain");
  o.drawn_beyond = d.real("beyond", 1.5, at_least(1), "",
                          "strains and stresses reach this times what the trajectory saw (yield "
                          "surfaces are visited up to `strain` even so)");
  o.drawn_affine = d.interval("affine", o.drawn_affine, positive(), "1/s",
                              "norm of the affine velocity, log-uniform");
}

}  // namespace

GenerateOptions read_generate_options(Section& config) {
  GenerateOptions o;
  o.seed = static_cast<std::uint64_t>(
      config.integer("seed", 1, between(0, 9e15), "", "everything random follows from it"));
  const std::string split =
      config.choice("split", "train", {"train", "heldout_materials", "heldout_all"},
                    "heldout_materials: new parameters; heldout_all: new shapes and motions too");
  o.split = split_from_name(split);
  read_draw_options(config, o);
  read_random_laws(config, o);
  return o;
}

void read_random_laws(Section& config, GenerateOptions& o) {
  Section s = config.section(
      "random_laws",
      "laws drawn at random around the five families answer states of their trajectories");
  const std::array<std::array<const char*, 2>, 3> keys{
      {{"solids",
        "of states of elastic: one to three terms of Ogden's and Seth and Hill's, and an "
        "equation of state"},
       {"fluids",
        "of states of newtonian: an equation of state, and a viscosity that may change "
        "with the rate"},
       {"plastics",
        "of states of plasticine, sand and non_newtonian: curved caps with cohesion, "
        "crushing and the Lode angle, and rates of flow"}}};
  for (const RandomLawKind kind : kRandomLawKinds) {
    const auto [key, text] = keys[static_cast<std::size_t>(kind)];
    std::int64_t& count = o.random_laws[static_cast<std::size_t>(kind)];
    count = s.integer(key, 0, between(0, 100000), "", text);
    if (count > 0 && bases_of(o, kind).empty() && !s.describing()) {
      s.fail(key, fmt::format("expected 0 where `materials` has none of which states are taken, "
                              "found {}",
                              count));
    }
  }
}

void read_draw_options(Section& config, GenerateOptions& o) {
  o.trajectories = config.integer("trajectories", o.trajectories, between(1, 100000), "",
                                  "trajectories of each material");
  o.attempts = config.integer("attempts", 20, between(1, 1000), "",
                              "draws for one trajectory: a run that fails is replaced");
  read_materials(config, o);
  read_simulation(config, o);
  read_bodies(config, o);
  read_samples(config, o);
}

const char* split_name(Split split) {
  switch (split) {
    case Split::train:
      return "train";
    case Split::heldout_materials:
      return "heldout_materials";
    case Split::heldout_all:
      break;
  }
  return "heldout_all";
}

Split split_from_name(const std::string& name) {
  for (const Split split : {Split::train, Split::heldout_materials, Split::heldout_all}) {
    if (name == split_name(split)) return split;
  }
  throw Error("expected a split from train, heldout_materials, heldout_all, found \"" + name +
              "\"");
}

}  // namespace uniphy
