#include <cmath>
#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/adaptation_options.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/inference/fit_findings.hpp"
#include "uniphy/inference/several_bodies.hpp"
#include "uniphy/report/experiment.hpp"

namespace {

using namespace uniphy;

/// A body of the observation with what was found of it. Of several, `folder` is that of its files.
struct Found {
  std::string name, folder;
  const Observation& observation;
  const Inference& result;

  std::string file(const char* product) const { return folder + product; }
  std::string title(const char* of) const { return name.empty() ? of : name + ": " + of; }
  std::string metric(const std::string& of) const { return name.empty() ? of : name + "." + of; }
};

/// What is printed of the result, and the motions, in the report.
void show(const Found& found, const FitVariables& variables, Report* report) {
  if (report == nullptr) return;
  const Inference& result = found.result;
  report->set_table(found.title("Result"),
                    fit_summary(result.fit, variables) +
                        (result.fit.determined ? belief_text(result.material) : ""));
  const std::string rungs = rung_table(result.rung, result.rungs);
  if (!rungs.empty()) report->set_table(found.title("Adaptation"), rungs);
  report->playbacks.push_back(fit_playback(result, found.title("Fit")));
}

/// The adapted law where there is one; none of an earlier run where there is not.
std::string write_adapted(const Found& found, const std::filesystem::path& model,
                          RunDirectory& out) {
  const std::filesystem::path file = out.file(found.file("model.h5"));
  if (found.result.rung != Rung::latent) {
    write_model(file, adapted_model(found.result, found.observation, out.config_yaml()));
    return file.string();
  }
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  return model.string();
}

void write_found(const Found& found, const FitVariables& variables,
                 const std::filesystem::path& trained, RunDirectory& out, Metrics& metrics) {
  const Inference& result = found.result;
  if (!found.folder.empty()) std::filesystem::create_directories(out.file(found.folder));
  const std::string model = write_adapted(found, trained, out);
  write_latent(out.file(found.file("latent.h5")),
               latent_of(result, found.observation, variables, model, out.config_yaml()));
  write_trajectory(out.file(found.file("trajectory.h5")), result.fitted);
  std::error_code ignored;
  if (result.fit.history.empty()) {
    std::filesystem::remove(out.file(found.file("loss.png")), ignored);  // none of an earlier run
  } else {
    out.draw(found.file("loss.png"), loss_chart(result.fit, variables, found.title("Inference")));
  }
  write_misfit(out.file(found.file("residual.csv")), result.misfit);
  Chart misfit = misfit_chart(result.misfit);
  misfit.title = found.title(misfit.title.c_str());
  out.draw(found.file("residual.png"), misfit);
  const Trajectory seen = observed_trajectory(result.seen);
  plot_particles(out.file(found.file("frames.png")),
                 frames_picture({{"observed", &seen}, {"fitted", &result.fitted}}, 5,
                                found.observation.cloud > 0));
  show(found, variables, out.report());
  Metrics own;
  add_metrics(own, result, found.observation, variables);
  for (const auto& [name, value] : own.entries()) metrics.set(found.metric(name), value);
}

/// Returns whether there is an answer.
bool print_found(const Found& found, const FitVariables& variables) {
  const Inference& result = found.result;
  if (!found.name.empty()) std::printf("%s\n", found.name.c_str());
  std::printf("fit_mse %.3e m^2, root/size %.3f %%, best start %.3e m^2, %d roll-outs\n",
              result.fit_mse, 100 * std::sqrt(result.fit_mse) / result.size, result.best_start,
              result.roll_outs);
  std::fputs(rung_table(result.rung, result.rungs).c_str(), stdout);
  std::fputs(fit_summary(result.fit, variables).c_str(), stdout);
  if (result.fit.determined) std::fputs(belief_text(result.material).c_str(), stdout);
  std::fflush(stdout);
  return result.fit.determined;
}

void run(const ObservationSource& observed, const FitVariablesSource& source,
         const FitOptions& options, const AdaptationOptions& adaptation, RunDirectory& out,
         Metrics& metrics) {
  std::error_code ignored;
  if (std::filesystem::equivalent(source.model, out.file("model.h5"), ignored)) {
    throw Error(source.model.string() +
                ": law.model: expected a file that this run does not write, "
                "found the model.h5 of its own folder");
  }
  const std::string file = observed.file.string();
  std::vector<std::string> warnings;
  const std::vector<ObservedBody> bodies = observed.load(warnings);
  const auto variables = source.load();
  FitHooks hooks;
  hooks.state_file = out.file("state.h5");
  for (const ObservedBody& body : bodies)
    hooks.fingerprint += fit_fingerprint(body.motion, *variables, out.config_yaml());
  BodiesInference result;
  const bool several = bodies.size() > 1 || !bodies.front().name.empty();
  if (several) {
    result = infer_bodies(bodies, file, *variables, options, hooks, adaptation);
  } else {
    result.bodies.push_back(
        infer(bodies.front().motion, file, *variables, options, hooks, adaptation));
    result.state_files = {hooks.state_file, adaptation_state_file(hooks.state_file)};
  }

  bool answers = true;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const std::string& name = bodies[b].name;
    const Found found{name, several ? name + "/" : "", bodies[b].motion, result.bodies[b]};
    write_found(found, *variables, source.model, out, metrics);
    answers = print_found(found, *variables) && answers;
    for (const std::string& warning : fit_warnings(found.result, found.observation, *variables))
      warnings.push_back(several ? name + ": " + warning : warning);
    if (several) {
      metrics.set(found.metric("group"), result.group[b]);
      metrics.set(found.metric("fits"), result.rounds[b]);
    }
  }
  if (!answers) out.set_no_answer();
  for (const std::filesystem::path& state : result.state_files)
    std::filesystem::remove(state, ignored);  // a finished fit is not resumed
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
       "DIR/state.h5        while it runs: where it can be resumed, with adaptation_state.h5",
       "DIR/NAME/...        these files for each of several bodies, which are fitted with each "
       "other "
       "moving along where they meet"},
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
