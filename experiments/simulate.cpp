#include "uniphy/report/experiment.hpp"
#include "uniphy/scene/scene_config.hpp"
#include "uniphy/scene/simulation_run.hpp"

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_simulate",
      "Simulates a scene of one or several bodies in the unit cube with the material point method: "
      "each body has a shape, a motion and a law (analytic, or a trained model with a latent "
      "code).",
      {"CONFIG.yaml         the scene",
       "meshes (OBJ), particles (HDF5 or text), models (model.h5) and latents that it names"},
      {"DIR/trajectory.h5   positions in every frame, the last state (layout: "
       "uniphy/io/trajectory.hpp); of a run that fails, what it has until then",
       "DIR/trajectory.xdmf opens it in ParaView", "DIR/frames.png      a strip of pictures",
       "DIR/observation.h5  with output.observation=true, what uniphy_infer may see of it"},
      {"uniphy_simulate configs/simulate/benchmark_cube.yaml --out out/cube",
       "uniphy_simulate configs/simulate/benchmark_cube.yaml --set bodies.0.law.mu=5e5 "
       "--set scene.dt=auto",
       "uniphy_simulate configs/simulate/benchmark_cube.yaml "
       "--set scene.continue=out/cube/trajectory.h5 --out out/cube_on"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        const uniphy::SceneSource scene = uniphy::read_scene(config);
        const uniphy::SimulationOutput output = uniphy::read_simulation_output(config);
        return [=](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          uniphy::simulate_into(scene.load(), output, out, metrics);
        };
      });
}
