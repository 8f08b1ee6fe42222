#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/adaptation_options.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/fit_findings.hpp"
#include "uniphy/inference/infer_run.hpp"
#include "uniphy/report/experiment.hpp"

namespace {

/// What is printed of the result, and the motions, in the report.
void show(const uniphy::Inference& result, const uniphy::FitVariables& variables,
          uniphy::Report* report) {
  if (report == nullptr) return;
  report->set_table("Result", fit_summary(result.fit, variables) +
                                  (result.fit.determined ? belief_text(result.material) : ""));
  const std::string rungs = rung_table(result.rung, result.rungs);
  if (!rungs.empty()) report->set_table("Adaptation", rungs);
  report->playbacks.push_back(fit_playback(result, "Fit"));
}

/// The adapted law where there is one; none of an earlier run where there is not.
std::string write_adapted(const uniphy::Inference& result, const uniphy::Observation& observation,
                          const std::filesystem::path& model, uniphy::RunDirectory& out) {
  const std::filesystem::path file = out.file("model.h5");
  if (result.rung != uniphy::Rung::latent) {
    write_model(file, adapted_model(result, observation, out.config_yaml()));
    return file.string();
  }
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  return model.string();
}

void run(const uniphy::ObservationSource& observed, const uniphy::FitVariablesSource& source,
         const uniphy::FitOptions& options, const uniphy::AdaptationOptions& adaptation,
         uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
  using namespace uniphy;
  std::error_code none;
  if (std::filesystem::equivalent(source.model, out.file("model.h5"), none)) {
    throw Error(source.model.string() +
                ": law.model: expected a file that this run does not write, "
                "found the model.h5 of its own folder");
  }
  const std::filesystem::path& file = observed.file;
  std::vector<std::string> warnings;
  const Observation observation = observed.load(warnings);
  const auto variables = source.load();
  FitHooks hooks;
  hooks.state_file = out.file("state.h5");
  hooks.fingerprint = fit_fingerprint(observation, *variables, out.config_yaml());
  const Inference result =
      infer(observation, file.string(), *variables, options, hooks, adaptation);

  const std::string model = write_adapted(result, observation, source.model, out);
  write_latent(out.file("latent.h5"),
               latent_of(result, observation, *variables, model, out.config_yaml()));
  write_trajectory(out.file("trajectory.h5"), result.fitted);
  std::error_code ignored;
  if (result.fit.history.empty()) {
    std::filesystem::remove(out.file("loss.png"), ignored);  // none of an earlier run
  } else {
    out.draw("loss.png", loss_chart(result.fit, *variables, "Inference"));
  }
  write_misfit(out.file("residual.csv"), result.misfit);
  out.draw("residual.png", misfit_chart(result.misfit));
  const Trajectory seen = observed_trajectory(result.seen);
  plot_particles(
      out.file("frames.png"),
      frames_picture({{"observed", &seen}, {"fitted", &result.fitted}}, 5, observation.cloud > 0));
  show(result, *variables, out.report());
  add_metrics(metrics, result, observation, *variables);
  std::filesystem::remove(hooks.state_file, ignored);  // a finished fit is not resumed
  std::filesystem::remove(adaptation_state_file(hooks.state_file), ignored);

  std::printf("fit_mse %.3e m^2, root/size %.3f %%, best start %.3e m^2, %d roll-outs\n",
              result.fit_mse, 100 * *metrics.find("fit_root_over_size"), result.best_start,
              result.roll_outs);
  std::fputs(rung_table(result.rung, result.rungs).c_str(), stdout);
  std::fputs(fit_summary(result.fit, *variables).c_str(), stdout);
  if (result.fit.determined) {
    std::fputs(belief_text(result.material).c_str(), stdout);
  } else {
    out.set_no_answer();
  }
  std::fflush(stdout);
  for (const std::string& warning : fit_warnings(result, observation, *variables))
    warnings.push_back(warning);
  for (const std::string& warning : warnings) {
    std::fprintf(stderr, "warning: %s: %s\n", file.c_str(), warning.c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_infer",
      "Finds the material of an observed object: fits a latent code (or the parameters of a law) "
      "by gradients through the whole simulation, and then as much of the learned law itself as "
      "the "
      "motion asks for. An interrupted run goes on where it was. Where the observation does not "
      "determine "
      "the material, all files are written and the exit code is 3.",
      {"CONFIG.yaml         the observation, what is fitted, the schedule",
       "observation.h5      positions of particles or of tracked points and the body, times and "
       "the "
       "scene, nothing about the material (layout: uniphy/io/observation.hpp; uniphy_simulate "
       "writes one with output.observation=true, uniphy_observe makes of it what a laboratory "
       "sees)",
       "model.h5            a trained model (layout: uniphy/io/model_file.hpp)"},
      {"DIR/latent.h5       the fitted material (layout: uniphy/io/latent_file.hpp)",
       "DIR/model.h5        the adapted law that latent.h5 belongs to, where z alone did not do",
       "DIR/trajectory.h5   its roll-out at the observed frames, trajectory.xdmf for ParaView",
       "DIR/loss.png        loss of every candidate, where gradients were followed",
       "DIR/frames.png      observed and fitted",
       "DIR/residual.csv    what the fitted law leaves over time, residual.png the same as a chart",
       "DIR/state.h5        while it runs: where it can be resumed, with adaptation_state.h5"},
      {"uniphy_simulate configs/simulate/benchmark_cube.yaml --set output.observation=true --set "
       "scene.steps=400 --out out/cube",
       "uniphy_infer configs/infer/latent.yaml --set observation=out/cube/observation.h5 --out "
       "out/infer/cube",
       "uniphy_infer configs/infer/latent.yaml --set "
       "observation=out/identify/identify/sand/observation.h5 --out out/infer/sand",
       "uniphy_infer configs/infer/elastic.yaml"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        const uniphy::ObservationSource observed = uniphy::read_observation_source(config);
        const uniphy::FitVariablesSource source = uniphy::read_fit_variables(config);
        const uniphy::FitOptions options = uniphy::read_fit_options(config);
        const uniphy::AdaptationOptions adaptation = uniphy::read_adaptation_options(config);
        return [=](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          run(observed, source, options, adaptation, out, metrics);
        };
      });
}
