#include "uniphy/io/observation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/physical_limits.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-observation";
constexpr const char *kTrackedPoints = "points", *kNoCorrespondence = "none";

/// `fail(object, message)` throws, naming the file.
using Fail = std::function<void(const std::string& object, const std::string& message)>;

void check_inside(const std::vector<double>& x, const char* object, const char* row, bool hidden,
                  const Fail& fail) {
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (x[k] >= 0 && x[k] <= 1) continue;
    if (hidden && std::isnan(x[k])) continue;
    fail(object, fmt::format("expected positions inside the unit cube, found {} m of {} {}", x[k],
                             row, k / 3));
  }
}

/// Whether the body stands beside the points, in /body.
bool has_body_group(const Observation& o) { return o.tracked() || o.cloud > 0; }

void check_clouds(const Observation& o, const Fail& fail) {
  if (o.tracked()) fail("/x", "expected tracked points or clouds, found both");
  if (o.body.empty() && o.vertices.empty()) {
    fail("/body", "expected the particles or the surface of the body beside clouds, found neither");
  }
  std::int64_t frames = 0;
  for (std::int64_t f = 0; f < o.frames; ++f) {
    std::int64_t p = 0;
    while (p < o.cloud && !o.is_seen(f, p)) ++p;
    if (p < o.cloud) ++frames;
  }
  if (frames < 2) {
    fail("/x", fmt::format("expected at least two frames with a point (attribute correspondence: "
                           "\"{}\"), found {}",
                           kNoCorrespondence, frames));
  }
}

void check_points(const Observation& o, const Fail& fail) {
  if (o.frames < 2 || o.points() < 1) {
    fail("/x", fmt::format("expected at least two frames of one point, found {} of {}", o.frames,
                           o.points()));
  }
  const std::int64_t numbers = 3 * o.frames * o.points();
  if (static_cast<std::int64_t>(o.x.size()) != numbers) {
    fail("/x", fmt::format("expected {} numbers for the shape [{}, {}, 3], found {}", numbers,
                           o.frames, o.points(), o.x.size()));
  }
  for (std::size_t i = 1; i < o.time.size(); ++i) {
    if (o.time[i] <= o.time[i - 1]) {
      fail("/time", fmt::format("expected increasing times, found {} s after {} s", o.time[i],
                                o.time[i - 1]));
    }
  }
  const auto count = static_cast<std::size_t>(o.points());
  for (std::size_t k = 0; k < o.x.size(); ++k) {
    const std::size_t point = k / 3 % count, frame = k / 3 / count;
    const auto at = [&] { return fmt::format("of point {} in frame {}", point, frame); };
    if (std::isnan(o.x[k])) {
      if (frame == 0 && !has_body_group(o)) {
        fail("/x", "expected every particle in the first frame, found NaN " + at());
      }
      for (std::size_t c = k - k % 3; c < k - k % 3 + 3; ++c) {
        if (!std::isnan(o.x[c])) {
          fail("/x", "expected three coordinates, or NaN in all of them, found both " + at());
        }
      }
    } else if (!(o.x[k] >= 0 && o.x[k] <= 1)) {
      fail("/x",
           fmt::format("expected positions inside the unit cube, found {} m {}", o.x[k], at()));
    }
  }
  if (o.cloud > 0) {
    check_clouds(o, fail);
  } else if (std::all_of(o.x.begin(), o.x.end(), [](double x) { return std::isnan(x); })) {
    fail("/x", "expected positions, found NaN alone");
  }
  if (!std::isnan(o.noise) && !(o.noise >= 0 && o.noise < 1)) {
    fail("attribute noise of /x", fmt::format("expected 0 to 1 m, found {}", o.noise));
  }
  if (o.start_degree < 0 || o.start_degree > kMostStartDegree) {
    fail("attribute start_degree of /x",
         fmt::format("expected 0 to {}, found {}", kMostStartDegree, o.start_degree));
  }
  if (o.start_degree > 0 && o.cloud > 0) {
    fail("attribute start_degree of /x",
         fmt::format("expected 0 of clouds without correspondence, found {}", o.start_degree));
  }
}

void check_surface(const Observation& o, const Fail& fail) {
  check_inside(o.vertices, "/body/vertices", "vertex", false, fail);
  const auto vertices = static_cast<std::int64_t>(o.vertices.size() / 3);
  for (std::size_t k = 0; k < o.triangles.size(); ++k) {
    if (o.triangles[k] >= 0 && o.triangles[k] < vertices) continue;
    fail("/body/triangles", fmt::format("expected vertices 0 to {}, found {} in triangle {}",
                                        vertices - 1, o.triangles[k], k / 3));
  }
}

void check_body(const Observation& o, const Fail& fail) {
  const bool apart = !o.body.empty();
  if (o.particles < 1) {
    fail(apart ? "/body/x" : "/x", "expected at least one particle, found none");
  }
  const char* volume_name = has_body_group(o) ? "/body/volume" : "/volume";
  double volumes = 0;
  for (const double volume : o.volume) {
    if (!(volume > 0)) fail(volume_name, fmt::format("expected volumes > 0, found {}", volume));
    volumes += volume;
  }
  if (volumes > 1) {
    fail(volume_name,
         fmt::format("expected a body that fits the unit cube, found {} m^3 in all", volumes));
  }
  check_inside(o.body, "/body/x", "particle", false, fail);
  const std::vector<double> start = o.start();
  if (start.size() > 3 && std::equal(start.begin() + 3, start.end(), start.begin())) {
    fail(apart ? "/body/x" : "/x",
         fmt::format("expected a body, found all {} particles at one place in the first frame",
                     o.particles));
  }
}

void check_scene(const Observation& observation, const Fail& fail) {
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

/// What has to hold of an observation whether it is written or read.
void check(const Observation& observation, const Fail& fail) {
  check_points(observation, fail);
  if (observation.vertices.empty()) {
    check_body(observation, fail);
  } else {
    check_surface(observation, fail);
  }
  check_scene(observation, fail);
}

void write_body(hdf5::Writer& writer, const Observation& o) {
  const std::int64_t particles = o.particles;
  const hdf5::Info volume{"m^3", "volume of each particle at rest"};
  if (!has_body_group(o)) {
    writer.write("volume", o.volume, {particles}, volume);
    return;
  }
  writer.group("body");
  if (!o.vertices.empty()) {
    writer.write("body/vertices", o.vertices, {std::int64_t(o.vertices.size() / 3), 3},
                 {"m", "closed surface of the body at the first frame"});
    writer.write("body/triangles", o.triangles, {std::int64_t(o.triangles.size() / 3), 3},
                 {"1", "rows of vertices"});
    return;
  }
  writer.write("body/x", o.body, {particles, 3}, {"m", "particles at the first frame"});
  writer.write("body/volume", o.volume, {particles}, volume);
}

void read_body(const hdf5::Reader& reader, Observation& o) {
  if (reader.has("body/vertices")) {
    if (reader.has("body/x")) {
      reader.fail("/body",
                  "expected particles (x, volume) or a surface (vertices, triangles), "
                  "found both");
    }
    o.vertices = reader.read<double>("body/vertices", {-1, 3}, hdf5::Values::finite);
    o.triangles = reader.read<std::int64_t>("body/triangles", {-1, 3});
    if (o.triangles.empty()) reader.fail("/body/triangles", "expected triangles, found none");
    return;
  }
  o.body = reader.read<double>("body/x", {-1, 3}, hdf5::Values::finite);
  o.particles = static_cast<std::int64_t>(o.body.size() / 3);
  o.volume = reader.read<double>("body/volume", {o.particles}, hdf5::Values::finite);
}

/// Whether the rows of a frame are points that are tracked from frame to frame.
bool read_correspondence(const hdf5::Reader& reader, std::int64_t version) {
  if (!reader.has_attribute("x", "correspondence")) return true;
  const std::string found = reader.attribute_text("x", "correspondence");
  if (found == kTrackedPoints) return true;
  if (version > 1 && found == kNoCorrespondence) return false;
  const std::string clouds = version > 1 ? fmt::format(" or \"{}\"", kNoCorrespondence) : "";
  reader.fail("attribute correspondence of /x",
              fmt::format("expected \"{}\"{} in version {}, found \"{}\"", kTrackedPoints, clouds,
                          version, found));
}

}  // namespace

std::vector<double> Observation::start() const {
  return body.empty() ? std::vector<double>(x.begin(), x.begin() + 3 * particles) : body;
}

bool Observation::shows_any(std::int64_t frame) const {
  return std::any_of(positions(frame), positions(frame + 1),
                     [](double x) { return !std::isnan(x); });
}

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
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", has_body_group(observation) ? 2 : 1);
  writer.write("x", observation.x, {observation.frames, observation.points(), 3},
               {"m", "observed positions, NaN where hidden"});
  if (!std::isnan(observation.noise)) writer.attribute("x", "noise", observation.noise);
  if (observation.cloud > 0) writer.attribute("x", "correspondence", kNoCorrespondence);
  if (observation.start_degree != 0) {
    writer.attribute("x", "start_degree", observation.start_degree);
  }
  writer.write("time", observation.time, {observation.frames}, {"s", "time of each frame"});
  write_body(writer, observation);
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
  const std::int64_t version = reader.check_format(kFormat, 2);
  Observation observation;
  observation.x = reader.read<double>("x", {-1, -1, 3});
  const hdf5::Shape shape = reader.shape("x");
  observation.frames = shape[0];
  if (reader.has_attribute("x", "noise")) observation.noise = reader.attribute_real("x", "noise");
  const bool tracked = read_correspondence(reader, version);
  const auto integer = [&](const char* object, const char* name) {
    // The nearest int is out of every range that check() knows, too.
    return static_cast<int>(std::clamp<std::int64_t>(reader.attribute_integer(object, name),
                                                     std::numeric_limits<int>::min(),
                                                     std::numeric_limits<int>::max()));
  };
  if (reader.has_attribute("x", "start_degree"))
    observation.start_degree = integer("x", "start_degree");
  observation.time = reader.read<double>("time", {observation.frames}, hdf5::Values::finite);
  if (version == 1) {
    observation.particles = shape[1];
    observation.volume =
        reader.read<double>("volume", {observation.particles}, hdf5::Values::finite);
  } else {
    if (shape[0] < 1 || shape[1] < 1) {
      reader.fail("/x", fmt::format("expected at least two frames of one point, found {} of {}",
                                    shape[0], shape[1]));
    }
    read_body(reader, observation);
    if (tracked) {
      observation.tracers.assign(observation.x.begin(), observation.x.begin() + 3 * shape[1]);
    } else {
      observation.cloud = shape[1];
    }
  }
  observation.grid = integer("scene", "grid");
  observation.dt = reader.attribute_real("scene", "dt");
  const auto gravity = reader.attribute_reals("scene", "gravity", 3);
  observation.gravity = {gravity[0], gravity[1], gravity[2]};
  observation.walls = reader.attribute_text("scene", "walls");
  observation.bound = integer("scene", "bound");
  observation.density = reader.attribute_real("scene", "density");
  check(observation, [&](const std::string& object, const std::string& message) {
    reader.fail(object, message);
  });
  return observation;
}

}  // namespace uniphy
