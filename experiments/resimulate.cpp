#include <algorithm>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/scene/law_config.hpp"
#include "uniphy/scene/scene_config.hpp"
#include "uniphy/scene/simulation_run.hpp"

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_resimulate",
      "Puts a material that uniphy_infer has identified into another scene: other shapes, other "
      "places, other velocities.",
      {"CONFIG.yaml         the scene, and where the fitted material is",
       "latent.h5           from the output folder of uniphy_infer, and the model that it names"},
      {"DIR/trajectory.h5   positions in every frame, the last state (layout: "
       "uniphy/io/trajectory.hpp)",
       "DIR/trajectory.xdmf opens it in ParaView", "DIR/frames.png      a strip of pictures"},
      {"uniphy_resimulate configs/resimulate/falling_torus.yaml --set "
       "fitted.latent=out/infer/cube"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        uniphy::Section fitted = config.section("fitted", "the identified material");
        const std::filesystem::path latent = fitted.input_path(
            "latent", uniphy::required, "latent.h5, or the output folder that holds it");
        const std::filesystem::path model = fitted.input_file(
            "model", std::string(), "model file; absent: the one that the latent file names");
        const auto bodies = fitted.texts("bodies", std::vector<std::string>(),
                                         "names of the bodies made of it; empty: all");
        // Bodies that keep a law of their own must have one; where all are replaced, none needs it.
        const uniphy::SceneSource source = uniphy::read_scene(config, !bodies.empty());
        const auto names = source.body_names();
        for (const std::string& name : bodies) {
          if (std::find(names.begin(), names.end(), name) == names.end()) {
            fitted.fail("bodies", "expected names of bodies of the scene, found \"" + name + "\"");
          }
        }
        const uniphy::SimulationOutput output = uniphy::read_simulation_output(config);
        return [=](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          uniphy::SceneDescription scene = source.load();
          uniphy::LawOrigin origin;
          const auto law = uniphy::load_fitted_law(latent, model, &origin);
          for (uniphy::BodyDescription& body : scene.bodies) {
            const bool chosen = std::find(bodies.begin(), bodies.end(), body.name) != bodies.end();
            if (!bodies.empty() && !chosen) continue;
            body.law = law;
            body.law_origin = origin;
          }
          uniphy::simulate_into(scene, output, out, metrics);
        };
      });
}
