#include "uniphy/io/observation_rules.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "uniphy/io/physical_limits.hpp"

namespace uniphy {
namespace {

void check_inside(const std::vector<double>& x, const char* object, const char* row, bool hidden,
                  const Failure& fail) {
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (x[k] >= 0 && x[k] <= 1) continue;
    if (hidden && std::isnan(x[k])) continue;
    fail(object, fmt::format("expected positions inside the unit cube, found {} m of {} {}", x[k],
                             row, k / 3));
  }
}

void check_clouds(const Observation& o, const Failure& fail) {
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
                           "\"none\"), found {}",
                           frames));
  }
}

void check_points(const Observation& o, const Failure& fail) {
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

void check_surface(const Observation& o, const Failure& fail) {
  check_inside(o.vertices, "/body/vertices", "vertex", false, fail);
  const auto vertices = static_cast<std::int64_t>(o.vertices.size() / 3);
  for (std::size_t k = 0; k < o.triangles.size(); ++k) {
    if (o.triangles[k] >= 0 && o.triangles[k] < vertices) continue;
    fail("/body/triangles", fmt::format("expected vertices 0 to {}, found {} in triangle {}",
                                        vertices - 1, o.triangles[k], k / 3));
  }
}

void check_body(const Observation& o, const Failure& fail) {
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

void check_scene(const Observation& observation, const Failure& fail) {
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

bool has_body_group(const Observation& o) { return o.tracked() || o.cloud > 0; }

void check_observation_rules(const Observation& observation, const Failure& fail) {
  check_points(observation, fail);
  if (observation.vertices.empty()) {
    check_body(observation, fail);
  } else {
    check_surface(observation, fail);
  }
  check_scene(observation, fail);
}

}  // namespace uniphy
