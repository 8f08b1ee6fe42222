#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/laboratory_view.hpp"
#include "uniphy/report/experiment.hpp"

namespace {

using uniphy::ObservedBody;

/// As a laboratory would see the bodies: each with a noise and points of its own.
std::vector<ObservedBody> view_of(const std::vector<ObservedBody>& all,
                                  uniphy::LaboratoryView view) {
  std::vector<ObservedBody> seen;
  for (const ObservedBody& body : all) {
    try {
      seen.push_back({body.name, laboratory_view(body.motion, view)});
    } catch (const uniphy::Error& error) {
      if (body.name.empty()) throw;
      throw uniphy::Error(body.name + ": " + error.what());
    }
    ++view.seed;
  }
  return seen;
}

void show(const std::vector<ObservedBody>& all, const std::vector<ObservedBody>& seen,
          uniphy::Report* report) {
  if (report == nullptr) return;
  for (std::size_t b = 0; b < all.size(); ++b) {
    const uniphy::Observation& o = seen[b].motion;
    const double wall = o.bound / double(o.grid);
    report->playbacks.push_back(
        {all[b].name.empty() ? "Observation" : all[b].name,
         {motion_of("all there is", all[b].motion), motion_of("observed", o)},
         {},
         wall,
         1 - wall});
  }
}

}  // namespace

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_observe",
      "Makes of an observation that shows everything what a laboratory would see: a part of the "
      "points or clouds without correspondence, some of the frames, noise, hidden points.",
      {"CONFIG.yaml         what is seen",
       "observation.h5      of one body or of several, as uniphy_simulate writes it with "
       "output.observation=true"},
      {"DIR/observation.h5  what is left of it (layout: uniphy/io/observation.hpp)"},
      {"uniphy_observe configs/observe/tracked.yaml --set observation=out/cube/observation.h5"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        using uniphy::between;
        const std::filesystem::path file =
            config.input_file("observation", uniphy::required, "what there is to see");
        uniphy::LaboratoryView view;
        uniphy::Section points = config.section("points", "the tracked points");
        view.share = points.real("share", 1, uniphy::Range{0, 1, true}, "",
                                 "of the points, drawn; below 1 they are tracers, with the body of "
                                 "the first frame beside them");
        view.hidden = points.real("hidden", 0, between(0, 0.99), "",
                                  "share of their positions that is hidden, drawn");
        uniphy::Section cloud = config.section("cloud", "in place of tracked points");
        view.cloud = cloud.integer("points", 0, between(0, 1e9), "",
                                   "of each frame, drawn anew and in any order, without "
                                   "correspondence; 0: the points are tracked");
        uniphy::Section frames = config.section("frames", "when they are seen");
        view.first = frames.integer("first", 0, between(0, 1e9), "",
                                    "number of the first one; where the body is deformed in it, "
                                    "start_degree of uniphy_infer says so");
        view.stride = frames.integer("stride", 1, between(1, 1000000), "", "every so many");
        view.last =
            frames.integer("last", -1, between(-1, 1e9), "", "number of the last one; -1: all");
        uniphy::Section noise = config.section("noise", "of every coordinate, normal");
        view.noise = noise.real("over_size", 0, between(0, 1), "",
                                "standard deviation over the largest side of the body");
        view.says_noise = noise.boolean("known", true, "the observation says how large it is");
        view.seed = static_cast<std::uint64_t>(
            config.integer("seed", 1, between(0, 9e15), "", "of all that is drawn"));
        return [=](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          std::vector<ObservedBody> all, seen;
          try {
            all = uniphy::read_observed_bodies(file);
            seen = view_of(all, view);
          } catch (const uniphy::Error& error) {
            const std::string text = error.what(), name = file.string();
            throw uniphy::Error(text.rfind(name, 0) == 0 ? text : name + ": " + text);
          }
          write_observed_bodies(out.file("observation.h5"), seen);
          show(all, seen, out.report());
          for (const auto& [name, o] : seen) {
            const std::string suffix = name.empty() ? "" : "." + name;
            metrics.set("points" + suffix, static_cast<double>(o.points()));
            metrics.set("frames" + suffix, static_cast<double>(o.frames));
            metrics.set("noise" + suffix, o.noise);
            std::printf("%s%lld points in %lld frames, noise %.3g m\n",
                        name.empty() ? "" : (name + ": ").c_str(),
                        static_cast<long long>(o.points()), static_cast<long long>(o.frames),
                        o.noise);
          }
        };
      });
}
