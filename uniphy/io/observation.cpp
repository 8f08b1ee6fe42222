#include "uniphy/io/observation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/physical_limits.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-observation";

/// What has to hold of an observation whether it is written or read; fail(object, message).
template <class Fail>
void check(const Observation& observation, const Fail& fail) {
  if (observation.frames < 2 || observation.particles < 1) {
    fail("/x", fmt::format("expected at least two frames of one particle, found {} of {}",
                           observation.frames, observation.particles));
  }
  for (std::size_t i = 1; i < observation.time.size(); ++i) {
    if (observation.time[i] <= observation.time[i - 1]) {
      fail("/time", fmt::format("expected increasing times, found {} s after {} s",
                                observation.time[i], observation.time[i - 1]));
    }
  }
  double volumes = 0;
  for (const double volume : observation.volume) {
    if (!(volume > 0)) fail("/volume", fmt::format("expected volumes > 0, found {}", volume));
    volumes += volume;
  }
  if (volumes > 1) {
    fail("/volume",
         fmt::format("expected a body that fits the unit cube, found {} m^3 in all", volumes));
  }
  for (std::size_t k = 0; k < observation.x.size(); ++k) {
    if (observation.x[k] >= 0 && observation.x[k] <= 1) continue;
    const std::size_t particle = k / 3, count = std::size_t(observation.particles);
    fail("/x", fmt::format("expected positions inside the unit cube, found {} m of particle {} in "
                           "frame {}",
                           observation.x[k], particle % count, particle / count));
  }
  const auto row = static_cast<std::size_t>(3 * observation.particles);
  const bool one_place =
      row > 3 && observation.x.size() >= row &&
      std::equal(observation.x.begin() + 3, observation.x.begin() + row, observation.x.begin());
  if (one_place) {
    fail("/x",
         fmt::format("expected a body, found all {} particles at one place in the first frame",
                     observation.particles));
  }
  const auto scene = [&](bool good, const char* name, const std::string& message) {
    if (!good) fail(fmt::format("attribute {} of /scene", name), message);
  };
  scene(observation.grid >= 8 && observation.grid <= 1024, "grid",
        fmt::format("expected 8 to 1024 nodes, found {}", observation.grid));
  scene(observation.dt >= kLeastTimeStep && observation.dt < 1, "dt",
        fmt::format("expected a time step in [{}, 1) s, found {}", kLeastTimeStep, observation.dt));
  scene(observation.walls == "freeslip" || observation.walls == "noslip", "walls",
        fmt::format("expected \"freeslip\" or \"noslip\", found \"{}\"", observation.walls));
  scene(observation.bound >= 1 && observation.bound <= (observation.grid - 1) / 2, "bound",
        fmt::format("expected 1 to {} nodes, found {}", (observation.grid - 1) / 2,
                    observation.bound));
  scene(observation.density >= kLeastDensity && observation.density <= kLargestDensity, "density",
        fmt::format("expected a density of {} to {} kg/m^3, found {}", kLeastDensity,
                    kLargestDensity, observation.density));
  for (const double g : observation.gravity) {
    scene(std::abs(g) <= kLargestGravity, "gravity",
          fmt::format("expected at most {} m/s^2 either way, found {}", kLargestGravity, g));
  }
}

}  // namespace

Observation begin_observation(const kernels::GridSettings& grid, double density,
                              const std::vector<double>& volume) {
  Observation o;
  o.particles = static_cast<std::int64_t>(volume.size());
  o.volume = volume;
  o.grid = grid.n;
  o.dt = grid.dt;
  std::copy_n(grid.gravity, 3, o.gravity.begin());
  o.walls = grid.wall == kernels::Wall::noslip ? "noslip" : "freeslip";
  o.bound = grid.bound;
  o.density = density;
  return o;
}

void add_frame(Observation& observation, double time, const std::vector<double>& x) {
  observation.time.push_back(time);
  observation.x.insert(observation.x.end(), x.begin(), x.end());
  ++observation.frames;
}

void write_observation(const std::filesystem::path& file, const Observation& observation) {
  hdf5::Writer writer(file);
  check(observation, [&](const std::string& object, const std::string& message) {
    throw Error(fmt::format("{}: {}: {}", file.string(), object, message));
  });
  const std::int64_t frames = observation.frames;
  const std::int64_t particles = observation.particles;
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 1);
  writer.write("x", observation.x, {frames, particles, 3}, {"m", "observed positions"});
  writer.write("time", observation.time, {frames}, {"s", "time of each frame"});
  writer.write("volume", observation.volume, {particles},
               {"m^3", "volume of each particle at rest"});
  writer.group("scene");
  writer.attribute("scene", "grid", observation.grid);
  writer.attribute("scene", "dt", observation.dt);
  writer.attribute("scene", "gravity",
                   std::vector<double>(observation.gravity.begin(), observation.gravity.end()));
  writer.attribute("scene", "walls", observation.walls);
  writer.attribute("scene", "bound", observation.bound);
  writer.attribute("scene", "density", observation.density);
  writer.attribute("scene", "units", "grid, bound: nodes; dt: s; gravity: m/s^2; density: kg/m^3");
  writer.commit();
}

Observation read_observation(const std::filesystem::path& file) {
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
  Observation observation;
  observation.x = reader.read<double>("x", {-1, -1, 3}, hdf5::Values::finite);
  const hdf5::Shape shape = reader.shape("x");
  observation.frames = shape[0];
  observation.particles = shape[1];
  observation.time = reader.read<double>("time", {observation.frames}, hdf5::Values::finite);
  observation.volume = reader.read<double>("volume", {observation.particles}, hdf5::Values::finite);
  const auto integer = [&](const char* name) {
    // The nearest int is out of every range that check() knows, too.
    return static_cast<int>(std::clamp<std::int64_t>(reader.attribute_integer("scene", name),
                                                     std::numeric_limits<int>::min(),
                                                     std::numeric_limits<int>::max()));
  };
  observation.grid = integer("grid");
  observation.dt = reader.attribute_real("scene", "dt");
  const auto gravity = reader.attribute_reals("scene", "gravity", 3);
  observation.gravity = {gravity[0], gravity[1], gravity[2]};
  observation.walls = reader.attribute_text("scene", "walls");
  observation.bound = integer("bound");
  observation.density = reader.attribute_real("scene", "density");
  check(observation, [&](const std::string& object, const std::string& message) {
    reader.fail(object, message);
  });
  return observation;
}

}  // namespace uniphy
