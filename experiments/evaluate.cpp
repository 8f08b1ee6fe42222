#include "uniphy/evaluation/evaluate_stage.hpp"

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_evaluate",
      "kind: trajectory compares a trajectory with another of the same particles. position_mse is "
      "the mean over frames, particles and coordinates of the squared difference, in m^2 of the "
      "unit cube; root_over_size its root divided by the largest side of the object in the first "
      "frame.\nkind: heldout judges a trained law: it draws materials, shapes and motions that "
      "training never saw, fits z alone to samples of each, and compares law and roll-outs with "
      "the analytic ones.\nkind: outside fits a trained law to the first half of motions by laws "
      "that "
      "it was not built around, and judges its forecast of the second half beside that of every "
      "wrong analytic law.\nkind: open_world fits it to what a laboratory sees of motions by the "
      "five families (noise, tracked points, a truth from a finer grid) and judges the forecast by "
      "where all particles are. The last two go on where they were interrupted.",
      {"trajectory: two trajectories (trajectory.h5)", "heldout:    a trained model (model.h5)",
       "outside:    a trained model (model.h5); observations (observation.h5) if asked for",
       "open_world: a trained model (model.h5)"},
      {"trajectory:",
       "DIR/curve.csv       mean squared error of every frame",
       "DIR/curve.png       its root over the size of the object",
       "DIR/metrics.json    position_mse, root_mse, root_over_size, largest_distance, final_mse,",
       "                    size, frames, and position_mse.BODY where there are several",
       "heldout:",
       "DIR/metrics.json    stress_error.M, projection_error.M, rollout_error.M of every material",
       "                    M (medians over heldout_all), with .worst; the same of",
       "                    heldout_materials after that prefix; rollouts_failed,",
       "                    frame_indifference, rest_drift (m)",
       "DIR/errors.csv      every trajectory",
       "DIR/errors.md       the table",
       "DIR/rollout_errors.png, stress_errors.png, worst_rollout.png",
       "DIR/heldout_all.h5, heldout_materials.h5, the sets, as uniphy_generate writes them",
       "outside:",
       "DIR/metrics.json    forecast.LAW, fit.LAW (root over size), rung.LAW, explained.LAW,",
       "                    best_analytic.LAW: medians over scenes; the same of every scene with",
       "                    .SCENE after LAW; fits, motions_failed",
       "DIR/outside.md, outside.csv, forecast.png",
       "DIR/fits            finished fits, which a later run of the same folder reads",
       "open_world:",
       "DIR/metrics.json    forecast.CASE.M, floor.CASE.M (root over size), fit.CASE.M,",
       "                    explained.CASE.M, named_right.CASE.M, fit_s.CASE.M,",
       "                    fit_rollouts.CASE.M of every material M: medians over scenes; fits",
       "DIR/open_world.md, open_world.csv, DIR/fits",
       "materials:",
       "DIR/metrics.json    class_right.CASE, class_total.CASE, mu_error.CASE, lambda_error.CASE",
       "                    (elastic), yield_error.CASE (plasticine), friction_error.CASE (sand),",
       "                    coverage.CASE of their 90 % intervals; error.NUMBER.CASE.M,",
       "                    coverage.NUMBER.CASE.M of every material M; fits, fits_failed",
       "DIR/materials.md, materials.csv, DIR/fits"},
      {"uniphy_evaluate configs/evaluate/trajectory.yaml --set trajectory=out/resim/trajectory.h5 "
       "--set reference=out/truth/trajectory.h5",
       "uniphy_evaluate configs/evaluate/heldout.yaml --set seed=7",
       "uniphy_evaluate configs/evaluate/outside.yaml --set quick=true",
       "uniphy_evaluate configs/evaluate/open_world.yaml --set cases=[noise]",
       "uniphy_evaluate configs/evaluate/materials.yaml --set objects.count=2"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) { return uniphy::evaluate_stage(config); });
}
