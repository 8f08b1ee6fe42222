#include <algorithm>

#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/identify/identify.hpp"
#include "uniphy/inference/adaptation_options.hpp"

namespace uniphy {

IdentifyOptions read_identify_options(Section& config) {
  IdentifyOptions options;
  GenerateOptions& o = options.hidden.draw;
  o.split = Split::heldout_all;
  o.trajectories = 2;  // the observed scene and the other one
  o.attempts = 40;
  o.seed = static_cast<std::uint64_t>(
      config.integer("seed", 7, between(0, 9e15), "",
                     "materials, shapes and motions of the hidden objects follow from it"));
  std::vector<std::string> names;
  for (const MaterialRanges& ranges : default_material_ranges()) names.push_back(ranges.name());
  const auto chosen = config.choices("materials", names, names, "which are done", at_least(1));
  o.materials.clear();
  for (const MaterialRanges& ranges : default_material_ranges()) {
    if (std::find(chosen.begin(), chosen.end(), ranges.name()) != chosen.end()) {
      o.materials.push_back(ranges);
    }
  }

  Section s = config.section("scene", "both scenes of every object");
  o.grid.n = static_cast<int>(s.integer("grid", 20, between(16, 256), "", "nodes a side"));
  o.dt = s.real("dt", 5e-4, between(1e-6, 1e-3), "s",
                "time step; parameters that it is too long for are drawn again");
  o.steps = s.integer("steps", 1000, between(20, 100000), "", "steps of each scene");
  options.hidden.frame_stride =
      s.integer("frame_stride", 5, between(1, 1000), "", "steps from frame to frame");
  o.particles = s.integer("particles", 300, between(27, 100000), "", "about so many in a body");
  o.size = s.interval("size", std::array<double, 2>{0.22, 0.32}, between(0.1, 0.38), "m",
                      "largest side of a body");
  o.speed = s.interval("speed", std::array<double, 2>{1, 4}, between(0.1, 10), "m/s", "at first");
  o.gap = s.interval("gap", std::array<double, 2>{0.01, 0.06}, between(0, 0.2), "m",
                     "distance to the wall ahead");
  o.angular_speed = s.interval("angular_speed", std::array<double, 2>{0, 8}, between(0, 50),
                               "rad/s", "of every second body");
  o.heldout_shapes = s.choices(
      "shapes",
      o.heldout_shapes.empty() ? std::vector<std::string>{"blobby", "dodecahedron", "gear",
                                                          "knurling", "pawn", "rounded_cone", "toy"}
                               : o.heldout_shapes,
      shape_names(), "none that training saw", at_least(2));

  LaboratoryView& view = options.view;
  Section seen = config.section("observed", "what inference sees of the first scene");
  view.share = seen.real("points", 0.1, Range{0, 1, true}, "",
                         "share of the particles that is tracked, drawn");
  view.stride = seen.integer("every", 10, between(1, 1000), "", "frames of the scene, one is seen");
  view.noise = seen.real("noise", 0.005, between(0, 0.2), "",
                         "standard deviation of a coordinate over the size of the body");
  view.seed = o.seed;
  options.variables = read_fit_variables(config);
  Section fit = config.section("fit", "as in uniphy_infer");
  options.fit = read_fit_options(fit);
  options.adaptation = read_adaptation_options(config);
  return options;
}

}  // namespace uniphy
