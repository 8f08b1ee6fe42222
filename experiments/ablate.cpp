#include "uniphy/evaluation/ablation_stage.hpp"

int main(int argc, char** argv) {
  return uniphy::run_experiment(
      argc, argv,
      {"uniphy_ablate",
       "Trains laws that differ in form, width, latent size or data with one budget and measures "
       "what each is worth on held-out trajectories and what it costs, so that the smallest law "
       "that reaches an error can be read off. Finished variants are kept; an interrupted run "
       "resumes where it stopped.",
       {"CONFIG.yaml, nothing else: the data sets are drawn from its seed"},
       {"DIR/ablation.md             the tables", "DIR/ablation.csv            all numbers",
        "DIR/rollout_against_cost.png, stress_against_cost.png",
        "DIR/NAME/model.h5           the law of variant NAME, its history.csv, training.png and",
        "                            metrics.json", "DIR/data/*.h5               the data sets"},
       {"uniphy_ablate configs/ablation/ablation.yaml",
        "uniphy_ablate configs/ablation/ablation.yaml --set budget.steps=500 --out "
        "out/ablate/quick"}},
      [](uniphy::Section& config) { return uniphy::ablation_stage(config); });
}
