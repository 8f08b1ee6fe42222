#include <fmt/format.h>

#include "uniphy/data/generate_options.hpp"

namespace uniphy {
namespace {

std::string interval(const std::array<double, 2>& values) {
  return fmt::format("[{}, {}]", format_real(values[0]), format_real(values[1]));
}

std::string names(const std::vector<std::string>& list) {
  std::string text;
  for (const std::string& name : list) text += (text.empty() ? "" : ", ") + name;
  return "[" + text + "]";
}

std::string ranges(const GenerateOptions& o) {
  std::string text = "ranges:\n";
  for (const MaterialRanges& material : o.materials) {
    text += fmt::format("  {}:\n", material.name());
    for (const kernels::LawParameter& p : kernels::law_parameters(material.id))
      text += fmt::format("    {}: {}\n", p.name, interval(material.interval[p.place]));
  }
  return text;
}

std::string simulation(const GenerateOptions& o) {
  const double* g = o.grid.gravity;
  return fmt::format(
      "simulation:\n  grid: {}\n  bound: {}\n  wall: {}\n  gravity: [{}, {}, {}]\n  steps: {}\n"
      "  dt: {}\n  particles: {}\n  density: {}\n",
      o.grid.n, o.grid.bound, o.grid.wall == kernels::Wall::noslip ? "noslip" : "freeslip",
      format_real(g[0]), format_real(g[1]), format_real(g[2]), o.steps,
      o.dt ? format_real(*o.dt) : "auto", o.particles, format_real(o.density));
}

std::string bodies(const GenerateOptions& o) {
  return fmt::format(
      "body:\n  shapes: {}\n  heldout_shapes: {}\n  size: {}\n"
      "motion:\n  kinds: {}\n  speed: {}\n  impact_over_yield: {}\n  gap: {}\n"
      "  angular_speed: {}\n",
      names(o.shapes), names(o.heldout_shapes), interval(o.size), names(o.motions),
      interval(o.speed), interval(o.impact_over_yield), interval(o.gap), interval(o.angular_speed));
}

std::string samples(const GenerateOptions& o) {
  return fmt::format(
      "samples:\n  per_trajectory: {}\n  every: {}\n  uniform_share: {}\n  drawn:\n"
      "    share: {}\n    step: {}\n    strain: {}\n    beyond: {}\n    affine: {}\n",
      o.samples, o.every, format_real(o.uniform_share), format_real(o.drawn_share),
      format_real(o.drawn_step), format_real(o.drawn_strain), format_real(o.drawn_beyond),
      interval(o.drawn_affine));
}

std::string random_laws(const GenerateOptions& o) {
  return fmt::format("random_laws:\n  solids: {}\n  fluids: {}\n  plastics: {}\n", o.random_laws[0],
                     o.random_laws[1], o.random_laws[2]);
}

}  // namespace

std::string generate_config(const GenerateOptions& o) {
  std::vector<std::string> materials;
  for (const MaterialRanges& material : o.materials) materials.push_back(material.name());
  const std::string text =
      fmt::format("seed: {}\nsplit: {}\ntrajectories: {}\nattempts: {}\nmaterials: {}\n", o.seed,
                  split_name(o.split), o.trajectories, o.attempts, names(materials)) +
      ranges(o) + simulation(o) + bodies(o) + samples(o) + random_laws(o);
  // Through the reader once more, for its own way of writing a resolved configuration.
  const Config config = Config::parse(text, "configuration of a data set");
  Section root = config.root();
  read_generate_options(root);
  config.finish();
  return config.resolved();
}

}  // namespace uniphy
