#include "uniphy/identify/identify.hpp"

#include "uniphy/report/experiment.hpp"

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_identify",
      "The whole job for objects of undisclosed material: observe one, find the latent code that "
      "explains its motion, and predict another shape at another velocity. An interrupted run "
      "goes on with the materials that it has finished.",
      {"CONFIG.yaml              the scenes and the fit",
       "model.h5                 a trained model"},
      {"DIR/table.md             what is printed", "DIR/loss.png             loss of the fits",
       "DIR/strip.png            observed, fitted, re-simulated, and the truth there",
       "DIR/M/observation.h5     all that inference sees of material M",
       "DIR/M/latent.h5          its result", "DIR/M/fitted.h5          the observed scene again",
       "DIR/M/resimulated.h5     the other scene, DIR/M/other_truth.h5 what happens there",
       "DIR/M/loss.png           loss of every candidate",
       "DIR/M/case.h5            until all are done: that M is, and its row of the table"},
      {"uniphy_identify configs/identify/identify.yaml",
       "uniphy_identify configs/identify/identify.yaml --set seed=8 --out out/identify/seed8"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        const uniphy::IdentifyOptions options = uniphy::read_identify_options(config);
        return [options](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          uniphy::identify(options, out, metrics);
        };
      });
}
