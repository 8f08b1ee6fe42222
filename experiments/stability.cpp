#include "uniphy/stability/stability_stage.hpp"

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_stability",
      "Goes on purpose to where differentiable MPM and learned laws are known to break, by our "
      "methods and beside them by ones that are known to fail, and charts who survives. A setting "
      "holds where all is finite and physically bounded: gradients right to 1e-5, energy within "
      "what gravity and walls give, det F > 1e-6; it stops where an error names what is wrong; it "
      "fails where something is wrong in silence. A later run of the same folder resumes.",
      {"a trained model of the isotropic form (model.h5)"},
      {"DIR/stability.md    a row a stressor, a column a method: who holds, and the number behind "
       "it",
       "DIR/stability.csv   every number of every setting",
       "DIR/failures.csv    method, stressor, setting, first step, particle and cause of each",
       "DIR/survival.png    the map",
       "DIR/metrics.json    survives.STRESSOR.METHOD (0 to 1), gradient_error.STRESSOR.METHOD;",
       "                    cells, cells.METHOD, cells_survived.METHOD, cells_default,",
       "                    cells_default_survived; gradient_finite_share, gradient_error_max, and",
       "                    the same of each METHOD",
       "DIR/cells           finished settings, which a later run of the same folder reads"},
      {"uniphy_stability configs/stability/stability.yaml",
       "uniphy_stability configs/stability/stability.yaml --set quick=true --out "
       "out/stability/quick",
       "uniphy_stability configs/stability/stability.yaml --set stressors=[spectral]"}};
  return uniphy::run_experiment(argc, argv, info, [](uniphy::Section& config) {
    return uniphy::stability::stability_stage(config);
  });
}
