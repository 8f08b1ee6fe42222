#include "uniphy/data/generate.hpp"

#include <cstdio>

#include "uniphy/report/experiment.hpp"

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_generate",
      "Draws materials, bodies and motions, simulates them and stores informative samples of the "
      "laws (trial F, projected F, C, Kirchhoff stress). An interrupted run goes on when it is "
      "started again with the same configuration and directory.",
      {"CONFIG.yaml, nothing else"},
      {"DIR/dataset.h5    /samples/{F,F_proj,C,tau,trajectory,source} and /trajectories/...",
       "                  (layout: uniphy/io/dataset.hpp)"},
      {"uniphy_generate configs/generate/train.yaml --out out/train",
       "uniphy_generate configs/generate/heldout_all.yaml --set seed=7 --out out/heldout"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        const uniphy::GenerateOptions options = uniphy::read_generate_options(config);
        return [options](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          uniphy::generate_dataset(options, out.config_yaml(), out.file("dataset.h5"), metrics);
          std::printf("%.0f samples of %.0f trajectories\n", *metrics.find("samples"),
                      *metrics.find("trajectories"));
        };
      });
}
