#include "uniphy/evaluation/touching_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/evaluation/finished_fits.hpp"
#include "uniphy/evaluation/open_world_cases.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/inference/several_bodies.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

constexpr std::int64_t kFrameStride = 5;  ///< steps
constexpr const char* kBodies[] = {"lower", "upper"};
constexpr const char* kFamilies[] = {"elastic", "newtonian", "plasticine", "sand", "non_newtonian"};

struct TouchingOptions {
  FitVariablesSource learned;
  std::vector<OutsideTruth> laws;
  std::vector<OpenWorldCase> cases;
  double noise = 0.005;
  std::uint64_t seed = 1;
  std::int64_t steps = 1000, per_side = 8, pairs = 5;
  FitOptions fit;
  AdaptationOptions adaptation;
};

/// One pair.
struct Cell {
  OpenWorldCase c = OpenWorldCase::closed;
  std::array<std::string, 2> law;
  std::array<double, 2> fit{}, forecast{};
  std::array<std::string, 2> named;
  double seconds = 0;

  std::string name() const { return fmt::format("{}.{}.{}", case_name(c), law[0], law[1]); }
};

TouchingOptions read_options(Section& config) {
  TouchingOptions o;
  const bool quick = config.boolean("quick", false, "minutes: one pair, 400 steps");
  o.seed = static_cast<std::uint64_t>(
      config.integer("seed", 1, between(0, 9e15), "", "of the noise and the tracked points"));
  o.learned.model = config.input_file("model", "models/pretrained/unified.h5", "the trained law");
  const std::vector<std::string> cases{"closed", "noise", "tracked", "hidden", "cloud"};
  const std::vector<std::string> all(std::begin(kOpenWorldCases), std::end(kOpenWorldCases));
  for (const std::string& name : config.choices("cases", std::vector<std::string>{"closed"}, cases,
                                                "how both are observed", at_least(1))) {
    o.cases.push_back(
        static_cast<OpenWorldCase>(std::find(all.begin(), all.end(), name) - all.begin()));
  }
  o.noise = config.real("noise", 0.005, between(0, 0.2), "",
                        "standard deviation of a coordinate over the size, where there is noise");
  o.pairs = config.integer("pairs", quick ? 1 : 5, between(1, 5), "",
                           "the first of those that the families make, each above the one before");
  Section scene = config.section("scene", "two cubes, the upper one falls on the lower one");
  o.steps = scene.integer("steps", quick ? 400 : 1000, between(20, 100000), "",
                          "the first half is fitted");
  o.per_side = scene.integer("particles_per_side", 8, between(2, 40), "", "of each cube");
  for (const OutsideTruth& truth : default_outside_laws(false)) {
    for (const char* family : kFamilies) {
      if (truth.name == family) o.laws.push_back(truth);
    }
  }
  Section fit = config.section("fit", "as in uniphy_infer");
  o.fit = read_fit_options(fit);
  o.adaptation = read_adaptation_options(config);
  return o;
}

SceneDescription touching_scene(const TouchingOptions& o,
                                const std::array<kernels::LawDescription, 2>& laws) {
  SceneDescription scene;
  scene.dt = 5e-4;
  scene.steps = o.steps;
  scene.frame_stride = kFrameStride;
  for (int b = 0; b < 2; ++b) {
    BodyDescription body;
    body.name = kBodies[b];
    body.solid = make_shape("box");
    body.filling.kind = Filling::Kind::per_side;
    body.filling.count = o.per_side;
    body.placement.size = 0.3;
    body.placement.centre =
        b == 0 ? Eigen::Vector3d(0.5, 0.28, 0.5) : Eigen::Vector3d(0.53, 0.70, 0.48);
    body.velocity = b == 0 ? Eigen::Vector3d(0.3, -1, 0) : Eigen::Vector3d(-0.2, -3, 0.2);
    body.angular_velocity = b == 0 ? Eigen::Vector3d(0, 2, 0) : Eigen::Vector3d(2, 0, 3);
    body.law = laws[b];
    scene.bodies.push_back(body);
  }
  return scene;
}

/// Both bodies, all of them at all frames.
std::vector<ObservedBody> observe(const SceneDescription& scene) {
  const PlacedScene placed = place_scene(scene);
  std::vector<ObservedBody> bodies;
  for (int b = 0; b < 2; ++b) {
    const auto volume = placed.volume.begin();
    bodies.push_back(
        {kBodies[b], begin_observation(placed.grid, scene.bodies[b].density,
                                       {volume + placed.first[b], volume + placed.first[b + 1]})});
  }
  run_scene(scene, placed, {}, [&](double time, std::int64_t, const ParticleState& state) {
    for (int b = 0; b < 2; ++b) {
      const auto x = state.x.begin();
      add_frame(bodies[b].motion, time, {x + 3 * placed.first[b], x + 3 * placed.first[b + 1]});
    }
    return true;
  });
  return bodies;
}

/// Where all particles of a body are at the frames that are seen of it.
std::vector<double> truth_of(const Observation& whole, const Observation& seen) {
  std::vector<double> truth;
  for (std::int64_t f = 0; f < whole.frames; ++f) {
    if (std::find(seen.time.begin(), seen.time.end(), whole.time[f]) == seen.time.end()) continue;
    truth.insert(truth.end(), whole.positions(f), whole.positions(f + 1));
  }
  return truth;
}

void fit_pair(const TouchingOptions& o, const FitVariables& variables,
              const std::vector<ObservedBody>& whole, const std::filesystem::path& stem,
              Cell& cell) {
  std::vector<JudgedMotion> judged;
  std::vector<ObservedBody> half;
  for (int b = 0; b < 2; ++b) {
    const Observation seen = seen_in(cell.c, whole[b].motion, o.noise, o.seed + b);
    judged.push_back({seen, cell.name(), truth_of(whole[b].motion, seen)});
    half.push_back({kBodies[b], first_frames(seen, (seen.frames + 1) / 2)});
  }
  const auto start = std::chrono::steady_clock::now();
  const BodiesInference found =
      infer_bodies(half, cell.name(), variables, o.fit, FinishedFits::hooks(stem), o.adaptation);
  cell.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (int b = 0; b < 2; ++b) {
    const Inference &own = found.bodies[b], &other = found.bodies[1 - b];
    const Companion beside{other.seen.start(), other.seen.volume, other.seen.density, other.fit.law,
                           other.fit.motion};
    cell.fit[b] = std::sqrt(own.fit_mse) / own.size;
    cell.named[b] = own.material.reading.material;
    cell.forecast[b] =
        forecast_error(judged[b], own.seen, own.fit.law, own.fit.motion, o.fit.dtype, {beside});
  }
  for (const std::filesystem::path& state : found.state_files) {
    std::error_code ignored;
    std::filesystem::remove(state, ignored);
  }
}

Metrics metrics_of(const Cell& cell) {
  Metrics m;
  for (int b = 0; b < 2; ++b) {
    m.set(fmt::format("fit.{}", kBodies[b]), cell.fit[b]);
    m.set(fmt::format("forecast.{}", kBodies[b]), cell.forecast[b]);
    for (const char* family : kFamilies) {
      if (cell.named[b] == family) m.set(fmt::format("named.{}.{}", kBodies[b], family), 1);
    }
  }
  m.set("seconds", cell.seconds);
  return m;
}

void take(const Metrics& m, Cell& cell) {
  for (int b = 0; b < 2; ++b) {
    cell.fit[b] = m.find(fmt::format("fit.{}", kBodies[b])).value_or(std::nan(""));
    cell.forecast[b] = m.find(fmt::format("forecast.{}", kBodies[b])).value_or(std::nan(""));
    for (const char* family : kFamilies) {
      if (m.find(fmt::format("named.{}.{}", kBodies[b], family))) cell.named[b] = family;
    }
  }
  cell.seconds = m.find("seconds").value_or(0);
}

std::string table(const std::vector<Cell>& cells) {
  std::string text =
      "| observed | below | above | fit | forecast | named |\n|---|---|---|---|---|---|\n";
  const auto percent = [](double share) {
    return std::isfinite(share) ? fmt::format("{:.2g} %", 100 * share) : std::string("fails");
  };
  for (const Cell& c : cells) {
    text += fmt::format("| {} | {} | {} | {}, {} | {}, {} | {}, {} |\n", case_name(c.c), c.law[0],
                        c.law[1], percent(c.fit[0]), percent(c.fit[1]), percent(c.forecast[0]),
                        percent(c.forecast[1]), c.named[0], c.named[1]);
  }
  return text +
         "\nOf the body below and of the one above. Forecast: error of the second half over the "
         "size, of all particles.\n";
}

std::string csv(const std::vector<Cell>& cells) {
  std::string text = "case,body,law,other,fit,forecast,named,seconds\n";
  for (const Cell& c : cells) {
    for (int b = 0; b < 2; ++b) {
      text += fmt::format("{},{},{},{},{:.6g},{:.6g},{},{:.1f}\n", case_name(c.c), kBodies[b],
                          c.law[b], c.law[1 - b], c.fit[b], c.forecast[b], c.named[b], c.seconds);
    }
  }
  return text;
}

void run(const TouchingOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const auto variables = o.learned.load();
  const FinishedFits finished(out);
  std::vector<Cell> cells;
  for (std::int64_t pair = 0; pair < o.pairs; ++pair) {
    const std::array<const OutsideTruth*, 2> truth{&o.laws[pair],
                                                   &o.laws[(pair + 1) % o.laws.size()]};
    const std::vector<ObservedBody> whole =
        observe(touching_scene(o, {truth[0]->law.load(), truth[1]->law.load()}));
    for (const OpenWorldCase c : o.cases) {
      Cell cell;
      cell.c = c;
      cell.law = {truth[0]->name, truth[1]->name};
      std::fprintf(stderr, "%s (%zu of %zu)\n", cell.name().c_str(), cells.size() + 1,
                   std::size_t(o.pairs) * o.cases.size());
      Observation both = whole[0].motion;  // for the hash
      both.x.insert(both.x.end(), whole[1].motion.x.begin(), whole[1].motion.x.end());
      const std::filesystem::path stem = finished.stem(cell.name(), both, *variables);
      if (const auto found = FinishedFits::read(stem)) {
        take(*found, cell);
      } else {
        try {
          fit_pair(o, *variables, whole, stem, cell);
        } catch (const Error& error) {
          std::fprintf(stderr, "warning: %s: %s\n", cell.name().c_str(), error.what());
          cell.fit.fill(std::numeric_limits<double>::infinity());
          cell.forecast = cell.fit;
        }
        FinishedFits::write(stem, metrics_of(cell));
      }
      cells.push_back(cell);
      out.write_table("touching.md", "Two bodies", table(cells));
      write_text_file(out.file("touching.csv"), csv(cells));
    }
  }
  for (const Cell& c : cells) {
    for (int b = 0; b < 2; ++b) {
      const std::string name = fmt::format("{}.{}", c.name(), kBodies[b]);
      metrics.set("forecast." + name, c.forecast[b]);
      metrics.set("fit." + name, c.fit[b]);
      metrics.set("named_right." + name, c.named[b] == c.law[b] ? 1 : 0);
    }
    metrics.set("fit_s." + c.name(), c.seconds);
  }
  std::fputs(table(cells).c_str(), stdout);
}

}  // namespace

RunFunction touching_stage(Section& config) {
  const TouchingOptions o = read_options(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy
