#include "uniphy/evaluation/open_world_stage.hpp"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "uniphy/evaluation/finished_fits.hpp"
#include "uniphy/evaluation/open_world_cases.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

struct OpenWorldOptions {
  OutsideOptions outside;  ///< model, laws, scenes, fit
  std::vector<OpenWorldCase> cases;
  double noise = 0.005;
};

/// One fit.
struct Cell {
  OpenWorldCase c = OpenWorldCase::closed;
  std::string law, scene;
  double floor = 0, seconds = 0;
  Forecast result;
};

const std::vector<std::string>& families() {
  static const std::vector<std::string> names{"elastic", "newtonian", "plasticine", "sand",
                                              "non_newtonian"};
  return names;
}

OpenWorldOptions read_options(Section& config) {
  OpenWorldOptions o;
  OutsideOptions& outside = o.outside;
  outside.quick = config.boolean("quick", false, "minutes: the cube, 400 steps, two materials");
  outside.seed = static_cast<std::uint64_t>(config.integer(
      "seed", 1, between(0, 9e15), "", "of the drawn objects, the noise and the tracked points"));
  outside.learned.model =
      config.input_file("model", "models/pretrained/unified.h5", "the trained law");
  const auto materials = config.choices(
      "materials", outside.quick ? std::vector<std::string>{"elastic", "plasticine"} : families(),
      families(), "what moves, one law of each family", at_least(1));
  for (const OutsideTruth& truth : default_outside_laws(false)) {
    if (std::find(materials.begin(), materials.end(), truth.name) != materials.end())
      outside.laws.push_back(truth);
  }
  const std::vector<std::string> all(std::begin(kOpenWorldCases), std::end(kOpenWorldCases));
  for (const std::string& name :
       config.choices("cases", outside.quick ? std::vector<std::string>{"noise", "tracked"} : all,
                      all, "how it is observed; finer: on the cube alone", at_least(1))) {
    const auto at = std::find(all.begin(), all.end(), name) - all.begin();
    o.cases.push_back(static_cast<OpenWorldCase>(at));
  }
  o.noise = config.real("noise", 0.005, between(0, 0.2), "",
                        "standard deviation of a coordinate over the size of the object");
  read_outside_scenes(config, outside);
  Section fit = config.section("fit", "as in uniphy_infer");
  outside.fit = read_fit_options(fit);
  outside.adaptation = read_adaptation_options(config);
  return o;
}

std::string percent(double share) {
  return std::isfinite(share) ? fmt::format("{:.2g} %", 100 * share) : std::string("fails");
}

/// A line a case, a column a law: median forecast, floor where there is one, what it was called.
std::string table(const std::vector<Cell>& cells) {
  std::vector<std::string> laws, cases;
  const auto add = [](std::vector<std::string>& list, const std::string& name) {
    if (std::find(list.begin(), list.end(), name) == list.end()) list.push_back(name);
  };
  for (const Cell& cell : cells) {
    add(laws, cell.law);
    add(cases, case_name(cell.c));
  }
  std::string text = "| observed |", line = "|---|";
  for (const std::string& law : laws) {
    text += fmt::format(" {} |", law);
    line += "---|";
  }
  text += "\n" + line + "\n";
  for (const std::string& c : cases) {
    text += fmt::format("| {} |", c);
    for (const std::string& law : laws) {
      std::vector<double> forecasts, floors;
      std::size_t right = 0;
      for (const Cell& cell : cells) {
        if (cell.law != law || case_name(cell.c) != c) continue;
        forecasts.push_back(cell.result.forecast);
        floors.push_back(cell.floor);
        right += cell.result.material == law ? 1 : 0;
      }
      if (forecasts.empty()) {
        text += " – |";
        continue;
      }
      text += " " + percent(kernels::median(forecasts));
      if (const double floor = kernels::median(floors); floor > 1e-9)
        text += fmt::format(" (floor {})", percent(floor));
      text += fmt::format(", named {}/{} |", right, forecasts.size());
    }
    text += "\n";
  }
  return text +
         "\nError of the forecast of the second half over the size, of all particles, medians "
         "over scenes; floor: the true law with the true velocity on the grid of the fit; "
         "named: fits whose law behaves like that "
         "material.\n";
}

std::string csv(const std::vector<Cell>& cells) {
  std::string text = "case,law,scene,fit,forecast,floor,rung,explained,named,roll_outs,seconds\n";
  for (const Cell& c : cells) {
    text +=
        fmt::format("{},{},{},{:.6g},{:.6g},{:.6g},{},{},{},{:.0f},{:.1f}\n", case_name(c.c), c.law,
                    c.scene, c.result.fit, c.result.forecast, c.floor, c.result.rung,
                    c.result.explained ? 1 : 0, c.result.material, c.result.roll_outs, c.seconds);
  }
  return text;
}

void add_metrics(const std::vector<Cell>& cells, Metrics& metrics) {
  const auto median_of = [&](const Cell& like, const std::function<double(const Cell&)>& number) {
    std::vector<double> numbers;
    for (const Cell& c : cells) {
      if (c.c == like.c && c.law == like.law) numbers.push_back(number(c));
    }
    return kernels::median(numbers);
  };
  for (const Cell& cell : cells) {
    const std::string name = fmt::format("{}.{}", case_name(cell.c), cell.law);
    const auto set = [&](const char* what, const std::function<double(const Cell&)>& number) {
      metrics.set(fmt::format("{}.{}", what, name), median_of(cell, number));
    };
    set("forecast", [](const Cell& c) { return c.result.forecast; });
    set("floor", [](const Cell& c) { return c.floor; });
    set("fit", [](const Cell& c) { return c.result.fit; });
    set("explained", [](const Cell& c) { return c.result.explained ? 1.0 : 0.0; });
    set("fit_s", [](const Cell& c) { return c.seconds; });
    set("fit_rollouts", [](const Cell& c) { return c.result.roll_outs; });
    double right = 0, all = 0;
    for (const Cell& c : cells) {
      if (c.c != cell.c || c.law != cell.law) continue;
      all += 1;
      right += c.result.material == c.law ? 1 : 0;
    }
    metrics.set("named_right." + name, right / all);
  }
  metrics.set("fits", static_cast<double>(cells.size()));
}

void run(const OpenWorldOptions& o, RunDirectory& out, Metrics& metrics) {
  at::set_num_threads(out.threads());
  const OutsideOptions& outside = o.outside;
  const auto variables = outside.learned.load();
  const FinishedFits finished(out);
  const std::vector<OutsideScene> scenes = outside_scenes(outside);
  const std::size_t fits = scenes.size() * o.cases.size() * outside.laws.size();
  std::size_t done = 0;
  std::vector<Cell> cells;
  for (const OutsideTruth& truth : outside.laws) {
    const kernels::LawDescription law = truth.law.load();
    for (const OutsideScene& scene : scenes) {
      for (const OpenWorldCase c : o.cases) {
        ++done;
        // A cube is first; drawn objects have no lattice that a finer one could be blocks of.
        if (c == OpenWorldCase::finer && scene.name != scenes.front().name) continue;
        std::fprintf(stderr, "%s in %s, %s (%zu of %zu)\n", truth.name.c_str(), scene.name.c_str(),
                     case_name(c), done, fits);
        Cell cell;
        cell.c = c;
        cell.law = truth.name;
        cell.scene = scene.name;
        OpenWorldMotion made;
        try {
          made = open_world_motion(scene, law, c, o.noise, outside.seed);
        } catch (const Error& error) {
          std::fprintf(stderr, "warning: %s in %s: left out: %s\n", truth.name.c_str(),
                       scene.name.c_str(), error.what());
          continue;
        }
        cell.floor = made.floor;
        const std::filesystem::path stem =
            finished.stem(fmt::format("{}.{}.{}", cell.law, cell.scene, case_name(c)),
                          made.motion.seen, *variables);
        if (!FinishedFits::read(stem, cell.result, cell.seconds)) {
          const auto start = std::chrono::steady_clock::now();
          cell.result = forecast_or_failure(made.motion, "learned", *variables, outside.fit,
                                            outside.adaptation, FinishedFits::hooks(stem));
          cell.seconds =
              std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
          FinishedFits::write(stem, cell.result, cell.seconds);
        }
        cells.push_back(cell);
        out.write_table("open_world.md", "Forecasts", table(cells));
        write_text_file(out.file("open_world.csv"), csv(cells));
      }
    }
  }
  if (cells.empty()) throw Error("none of the motions could be made");
  add_metrics(cells, metrics);
  std::fputs(table(cells).c_str(), stdout);
}

}  // namespace

RunFunction open_world_stage(Section& config) {
  const OpenWorldOptions o = read_options(config);
  return [o](RunDirectory& out, Metrics& metrics) { run(o, out, metrics); };
}

}  // namespace uniphy
