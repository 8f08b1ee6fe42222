#include "uniphy/io/observation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/observation_rules.hpp"
#include "uniphy/io/plain_name.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-observation";
constexpr const char *kTrackedPoints = "points", *kNoCorrespondence = "none";
constexpr const char* kBodies = "bodies";

/// Of one body, in the group `at`, "" or "bodies/NAME/".
void write_motion(hdf5::Writer& writer, const Observation& o, const std::string& at) {
  const std::string x = at + "x";
  writer.write(x, o.x, {o.frames, o.points(), 3}, {"m", "observed positions, NaN where hidden"});
  if (!std::isnan(o.noise)) writer.attribute(x, "noise", o.noise);
  if (o.cloud > 0) writer.attribute(x, "correspondence", kNoCorrespondence);
  if (o.start_degree != 0) writer.attribute(x, "start_degree", o.start_degree);
  const std::int64_t particles = o.particles;
  const hdf5::Info volume{"m^3", "volume of each particle at rest"};
  if (!has_body_group(o)) {
    writer.write(at + "volume", o.volume, {particles}, volume);
    return;
  }
  const std::string body = at + "body";
  writer.group(body);
  if (!o.vertices.empty()) {
    writer.write(body + "/vertices", o.vertices, {std::int64_t(o.vertices.size() / 3), 3},
                 {"m", "closed surface of the body at the first frame"});
    writer.write(body + "/triangles", o.triangles, {std::int64_t(o.triangles.size() / 3), 3},
                 {"1", "rows of vertices"});
    return;
  }
  writer.write(body + "/x", o.body, {particles, 3}, {"m", "particles at the first frame"});
  writer.write(body + "/volume", o.volume, {particles}, volume);
}

void write_scene(hdf5::Writer& writer, const Observation& o) {
  writer.write("time", o.time, {o.frames}, {"s", "time of each frame"});
  writer.group("scene");
  writer.attribute("scene", "grid", o.grid);
  writer.attribute("scene", "dt", o.dt);
  writer.attribute("scene", "gravity", std::vector<double>(o.gravity.begin(), o.gravity.end()));
  writer.attribute("scene", "walls", o.walls);
  writer.attribute("scene", "bound", o.bound);
  writer.attribute("scene", "density", o.density);
  writer.attribute("scene", "units", "grid, bound: nodes; dt: s; gravity: m/s^2; density: kg/m^3");
}

void read_body(const hdf5::Reader& reader, const std::string& body, Observation& o) {
  if (reader.has(body + "/vertices")) {
    if (reader.has(body + "/x")) {
      reader.fail("/" + body,
                  "expected particles (x, volume) or a surface (vertices, triangles), "
                  "found both");
    }
    o.vertices = reader.read<double>(body + "/vertices", {-1, 3}, hdf5::Values::finite);
    o.triangles = reader.read<std::int64_t>(body + "/triangles", {-1, 3});
    if (o.triangles.empty()) {
      reader.fail("/" + body + "/triangles", "expected triangles, found none");
    }
    return;
  }
  o.body = reader.read<double>(body + "/x", {-1, 3}, hdf5::Values::finite);
  o.particles = static_cast<std::int64_t>(o.body.size() / 3);
  o.volume = reader.read<double>(body + "/volume", {o.particles}, hdf5::Values::finite);
}

/// Whether the rows of a frame are points that are tracked from frame to frame.
bool read_correspondence(const hdf5::Reader& reader, const std::string& x, bool clouds_allowed) {
  if (!reader.has_attribute(x, "correspondence")) return true;
  const std::string found = reader.attribute_text(x, "correspondence");
  if (found == kTrackedPoints) return true;
  if (clouds_allowed && found == kNoCorrespondence) return false;
  const std::string clouds = clouds_allowed ? fmt::format(" or \"{}\"", kNoCorrespondence)
                                            : " where the points are the particles";
  reader.fail("attribute correspondence of /" + x,
              fmt::format("expected \"{}\"{}, found \"{}\"", kTrackedPoints, clouds, found));
}

/// The nearest int is out of every range that the rules know, too.
int read_integer(const hdf5::Reader& reader, const std::string& object, const char* name) {
  return static_cast<int>(std::clamp<std::int64_t>(reader.attribute_integer(object, name),
                                                   std::numeric_limits<int>::min(),
                                                   std::numeric_limits<int>::max()));
}

/// Into `o`, which knows the scene. `apart`: the body stands beside the points.
void read_motion(const hdf5::Reader& reader, const std::string& at, bool apart, Observation& o) {
  const std::string x = at + "x";
  o.x = reader.read<double>(x, {-1, -1, 3});
  const hdf5::Shape shape = reader.shape(x);
  o.frames = shape[0];
  if (reader.has_attribute(x, "noise")) o.noise = reader.attribute_real(x, "noise");
  const bool tracked = read_correspondence(reader, x, apart);
  if (reader.has_attribute(x, "start_degree"))
    o.start_degree = read_integer(reader, x, "start_degree");
  o.time = reader.read<double>("time", {o.frames}, hdf5::Values::finite);
  if (!apart) {
    o.particles = shape[1];
    o.volume = reader.read<double>(at + "volume", {o.particles}, hdf5::Values::finite);
    return;
  }
  if (shape[0] < 1 || shape[1] < 1) {
    reader.fail("/" + x, fmt::format("expected at least two frames of one point, found {} of {}",
                                     shape[0], shape[1]));
  }
  read_body(reader, at + "body", o);
  if (tracked) {
    o.tracers.assign(o.x.begin(), o.x.begin() + 3 * shape[1]);
  } else {
    o.cloud = shape[1];
  }
}

Observation read_scene(const hdf5::Reader& reader) {
  Observation o;
  o.grid = read_integer(reader, "scene", "grid");
  o.dt = reader.attribute_real("scene", "dt");
  const auto gravity = reader.attribute_reals("scene", "gravity", 3);
  o.gravity = {gravity[0], gravity[1], gravity[2]};
  o.walls = reader.attribute_text("scene", "walls");
  o.bound = read_integer(reader, "scene", "bound");
  o.density = reader.attribute_real("scene", "density");
  return o;
}

/// `at` is the group of a body of several.
Failure failing(const hdf5::Reader& reader, const std::string& at) {
  return [&reader, at](const std::string& object, const std::string& message) {
    reader.fail(at.empty() ? object : object + " in /" + at.substr(0, at.size() - 1), message);
  };
}

ObservedBody read_one(const hdf5::Reader& reader, const std::string& name) {
  const std::string group = "bodies/" + name, at = group + "/";
  if (!is_plain_name(name)) {
    reader.fail("/" + group, "expected a name of letters, digits, _, - and . (no dot first)");
  }
  ObservedBody body{name, read_scene(reader)};
  if (reader.has_attribute(group, "density"))
    body.motion.density = reader.attribute_real(group, "density");
  read_motion(reader, at, !reader.has(at + "volume"), body.motion);
  check_observation_rules(body.motion, failing(reader, at));
  return body;
}

bool same_scene(const Observation& a, const Observation& b) {
  return a.time == b.time && a.grid == b.grid && a.dt == b.dt && a.gravity == b.gravity &&
         a.walls == b.walls && a.bound == b.bound;
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
  check_observation_rules(observation, [&](const std::string& object, const std::string& message) {
    throw Error(fmt::format("{}: {}: {}", file.string(), object, message));
  });
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", has_body_group(observation) ? 2 : 1);
  write_motion(writer, observation, "");
  write_scene(writer, observation);
  writer.commit();
}

Observation read_observation(const std::filesystem::path& file) {
  std::vector<ObservedBody> bodies = read_observed_bodies(file);
  if (bodies.size() > 1) {
    std::string names;
    for (const ObservedBody& b : bodies) names += (names.empty() ? "" : ", ") + b.name;
    throw Error(fmt::format("{}: /bodies: expected one body, found {} ({})", file.string(),
                            bodies.size(), names));
  }
  return std::move(bodies.front().motion);
}

std::vector<ObservedBody> read_observed_bodies(const std::filesystem::path& file) {
  const hdf5::Reader reader(file);
  const std::int64_t version = reader.check_format(kFormat, 2);
  std::vector<ObservedBody> bodies;
  if (version == 1 || !reader.has(kBodies)) {
    bodies.push_back({"", read_scene(reader)});
    read_motion(reader, "", version > 1, bodies.front().motion);
    check_observation_rules(bodies.front().motion, failing(reader, ""));
    return bodies;
  }
  if (reader.has("x")) reader.fail("/", "expected /x or /bodies, found both");
  for (const std::string& name : reader.members(kBodies)) bodies.push_back(read_one(reader, name));
  if (bodies.empty()) reader.fail("/bodies", "expected bodies, found none");
  return bodies;
}

void write_observed_bodies(const std::filesystem::path& file,
                           const std::vector<ObservedBody>& bodies) {
  const auto fail = [&](const std::string& object, const std::string& message) {
    throw Error(fmt::format("{}: {}: {}", file.string(), object, message));
  };
  if (bodies.empty()) fail("/bodies", "expected bodies, found none");
  const Observation& first = bodies.front().motion;
  if (bodies.size() == 1 && bodies.front().name.empty()) return write_observation(file, first);
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 2);
  write_scene(writer, first);
  writer.group(kBodies);
  std::set<std::string> names;
  for (const auto& [name, motion] : bodies) {
    const std::string group = std::string(kBodies) + "/" + name;
    if (!is_plain_name(name) || !names.insert(name).second) {
      fail("/" + group, "expected a name of its own of letters, digits, _, - and . (no dot first)");
    }
    check_observation_rules(motion,
                            [&, at = group](const std::string& object, const std::string& message) {
                              fail(object + " in /" + at, message);
                            });
    if (!same_scene(first, motion)) {
      fail("/" + group, "expected the times and the scene of the first body, found others");
    }
    writer.group(group);
    writer.attribute(group, "density", motion.density);
    write_motion(writer, motion, group + "/");
  }
  writer.commit();
}

}  // namespace uniphy
