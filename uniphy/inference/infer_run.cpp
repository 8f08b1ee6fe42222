#include "uniphy/inference/infer_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "ops/kernels/base/for_each.hpp"
#include "ops/kernels/base/hash.hpp"
#include "ops/kernels/loss/nearest_points.hpp"
#include "uniphy/inference/fit_findings.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/inference/reading_error.hpp"
#include "uniphy/inference/start_correction.hpp"

namespace uniphy {
namespace {

void add_weights(kernels::Hash& hash, const kernels::LawDescription& law) {
  if (law.weights == nullptr) return;
  for (const kernels::MlpWeights* network : {&law.weights->projection, &law.weights->stress}) {
    for (const auto& layer : network->layers) {
      hash.add(layer.weight);
      hash.add(layer.bias);
    }
  }
}

void add_material(Metrics& metrics, const MaterialBelief& belief) {
  metrics.set("material." + belief.reading.material, 1);
  for (const auto& [material, probability] : belief.probability) {
    metrics.set("probability." + material, probability);
  }
  for (const ReadingNumber& n : reading_numbers()) {
    const std::pair<const char*, double> numbers[] = {{"", belief.reading.*n.value},
                                                      {".low", belief.low.*n.value},
                                                      {".high", belief.high.*n.value}};
    for (const auto& [end, value] : numbers) {
      if (!std::isnan(value)) metrics.set(fmt::format("reading.{}{}", n.key, end), value);
    }
  }
}

/// Of the law found and of those drawn from the posterior, probed up to a strain.
MaterialBelief read_inference(const Inference& inference, const Adaptation& adapted,
                              const FitVariables& variables, double strain) {
  const FitResult& fit = inference.fit;
  const double dt = inference.seen.dt;
  const double duration = inference.seen.time.back() - inference.seen.time.front();
  std::vector<MaterialReading> samples(adapted.samples.size());
  kernels::for_each(static_cast<std::ptrdiff_t>(samples.size()), [&](std::ptrdiff_t i) {
    samples[i] = read_material(adapted.samples[i], dt, strain, duration);
  });
  const MaterialBelief belief =
      material_belief(read_material(fit.law, dt, strain, duration), samples);
  return with_reading_error(belief, reading_error(variables, belief.reading.material, dt, strain));
}

/// Of the points that are fitted at the observed frames, without positions.
Trajectory unfilled_trajectory(const Observation& observation) {
  Observation points = observation;
  if (points.cloud > 0) {  // of the particles, then
    points.cloud = 0;
    points.x = points.body;
  }
  Trajectory t = observed_trajectory(points);
  t.x.clear();
  return t;
}

}  // namespace

Trajectory observed_trajectory(const Observation& observation) {
  Trajectory t;
  t.frames = observation.frames;
  const std::int64_t points = observation.points();
  t.particles = points;
  t.body.assign(points, 0);
  t.volume = observation.volume;
  if (points != observation.particles || observation.tracked()) {
    const double all = std::accumulate(t.volume.begin(), t.volume.end(), 0.0);
    t.volume.assign(points, all / static_cast<double>(points));
  }
  t.mass = t.volume;
  for (double& m : t.mass) m *= observation.density;
  t.time = observation.time;
  for (const double time : observation.time) {
    t.step.push_back(std::llround((time - observation.time[0]) / observation.dt));
  }
  t.x = observation.x;
  return t;
}

Inference infer(const Observation& observation, const std::string& name,
                const FitVariables& variables, const FitOptions& options, const FitHooks& hooks,
                const AdaptationOptions& adaptation) {
  return conclude(
      adapt(with_known_starts(observation, name), name, variables, options, adaptation, hooks),
      name, variables, options, adaptation);
}

Inference conclude(const Adaptation& adapted, const std::string& name,
                   const FitVariables& variables, const FitOptions& options,
                   const AdaptationOptions& adaptation) {
  Inference result;
  result.fit = adapted.fit;
  result.rung = adapted.rung;
  result.rungs = adapted.rungs;
  result.roll_outs = adapted.roll_outs;
  result.seen = adapted.seen;
  const Observation& seen = result.seen;
  result.size = observed_size(seen);
  result.fitted = unfilled_trajectory(seen);
  const ObservedSteps steps = observed_steps(seen, name);
  const kernels::GridSettings grid = observed_grid(seen, name);
  result.check = check_observation(seen, steps, grid);
  const auto objective = make_motion_objective(seen, steps, grid, options.dtype, "fused",
                                               CloudDetail::all, options.companions);
  objective->simulate(result.fit.law, result.fit.motion,
                      [&](std::ptrdiff_t, const std::vector<double>& x) {
                        result.fitted.x.insert(result.fitted.x.end(), x.begin(), x.end());
                      });
  result.misfit = seen.cloud > 0
                      ? misfit_of_clouds(seen, result.fitted, adaptation.tolerance)
                      : misfit_of(seen, result.fitted, adaptation.tolerance, adapted.starts_fitted);
  result.fit_mse = std::pow(result.misfit.over_size * result.size, 2);
  result.best_start = *std::min_element(result.fit.start_mse.begin(), result.fit.start_mse.end());
  result.explained = explains(result);
  result.posterior = adapted.posterior;
  const FitPosterior& posterior = result.posterior;
  if (!posterior.spread.empty() && posterior.determined == 0) result.fit.determined = false;
  if (result.fit.determined) {
    std::vector<double> F = objective->deformations(result.fit.law, result.fit.motion, seen.frames);
    result.material = read_inference(result, adapted, variables, strain_seen(F));
    if (!seen.tracked()) result.deformation = std::move(F);
  }
  return result;
}

bool explains(const Inference& inference) {
  const double allowed = inference.misfit.allowed;
  bool explains = inference.misfit.over_size <= allowed;
  for (const RungReport& r : inference.rungs) {
    if (r.rung == inference.rung) explains = explains && r.kept <= inference.misfit.allowed_ahead;
  }
  return explains;
}

ModelFile adapted_model(const Inference& inference, const Observation& observation,
                        const std::string& config) {
  const kernels::LawDescription& law = inference.fit.law;
  ModelFile file;
  file.weights = *law.weights;
  file.latents = law.z;
  file.materials = {"adapted"};
  file.parameters = {no_parameters()};
  file.config = config;
  file.training_dt = {observation.dt, observation.dt};
  return file;
}

LatentFile latent_of(const Inference& inference, const Observation& observation,
                     const FitVariables& variables, const std::string& model,
                     const std::string& config) {
  const FitResult& fit = inference.fit;
  LatentFile file;
  file.law = kernels::law_name(fit.law.id);
  file.config = config;
  file.dt = observation.dt;
  file.determined = inference.fit.determined;
  file.rung = rung_name(inference.rung);
  file.explained = inference.explained;
  if (fit.law.id == kernels::LawId::learned) {
    file.model = model;
    file.z = fit.law.z;
    if (fit.determined) file.nearest = variables.nearest(fit.u, 5);
  } else {
    file.analytic = fit.law;
  }
  std::copy_n(fit.motion.centre.data(), 3, file.centre.begin());
  std::copy_n(fit.motion.linear.data(), 3, file.linear.begin());
  std::copy_n(fit.motion.angular.data(), 3, file.angular.begin());
  file.history = fit.history;
  return file;
}

std::optional<std::size_t> roll_outs_to_a_hundredth(const FitResult& fit) {
  const double best_start = *std::min_element(fit.start_mse.begin(), fit.start_mse.end());
  for (std::size_t i = 0; i < fit.history.size(); ++i) {
    const FitRecord& r = fit.history[i];
    if (r.stage + 1 == fit.stages && r.mse <= 0.01 * best_start) return i + 1;
  }
  return {};
}

void add_metrics(Metrics& metrics, const Inference& inference, const Observation& observation,
                 const FitVariables& variables) {
  const FitResult& fit = inference.fit;
  metrics.set("fit_mse", inference.fit_mse);
  metrics.set("fit_root_over_size", std::sqrt(inference.fit_mse) / inference.size);
  metrics.set("size", inference.size);
  metrics.set("best_start_mse", inference.best_start);
  metrics.set("roll_outs", static_cast<double>(fit.history.size()));
  metrics.set("roll_outs.all", static_cast<double>(inference.roll_outs));
  if (const auto count = roll_outs_to_a_hundredth(fit)) {
    metrics.set("roll_outs_to_a_hundredth", static_cast<double>(*count));
  }
  metrics.set("starts", static_cast<double>(fit.start_mse.size()));
  metrics.set("starts_failed",
              static_cast<double>(std::count_if(fit.start_mse.begin(), fit.start_mse.end(),
                                                [](double mse) { return !std::isfinite(mse); })));
  const ObservationCheck& check = inference.check;
  metrics.set("noise_over_size", check.noise / check.size);
  metrics.set("start_frames", static_cast<double>(check.free_frames));
  metrics.set("start_residual_over_size", check.start_residual / check.size);
  metrics.set("start_allowed_over_size", check.start_allowed / check.size);
  metrics.set("energy_gain_over_kinetic",
              check.kinetic > 0 ? check.energy_gain / check.kinetic : 0);
  const bool contact = fit.contact < observation.frames;
  metrics.set("contact", contact ? 1 : 0);
  if (contact) {
    metrics.set("contact_s", observation.time[fit.contact] - observation.time[0]);
  }
  metrics.set("determined", fit.determined ? 1 : 0);
  metrics.set("explained", inference.explained ? 1 : 0);
  metrics.set("rung", static_cast<double>(inference.rung));
  for (const RungReport& r : inference.rungs) {
    const std::string rung = rung_name(r.rung);
    metrics.set("fitted_over_size." + rung, r.fitted);
    metrics.set("kept_over_size." + rung, r.kept);
    metrics.set("roll_outs." + rung, r.roll_outs);
    metrics.set("seconds." + rung, r.seconds);
  }
  const char* axes[] = {"x", "y", "z"};
  for (int k = 0; k < 3; ++k) {
    metrics.set(fmt::format("velocity.{}", axes[k]), fit.motion.linear[k]);
    metrics.set(fmt::format("angular_velocity.{}", axes[k]), fit.motion.angular[k]);
  }
  if (!inference.posterior.spread.empty()) {
    metrics.set("directions", static_cast<double>(inference.posterior.spread.size()));
    metrics.set("directions_determined", inference.posterior.determined);
    metrics.set("dispersion", inference.posterior.dispersion);
  }
  if (!fit.determined) return;
  add_material(metrics, inference.material);
  metrics.set("nearest.distance", variables.nearest(fit.u, 1).front().distance);
  for (const FittedParameter& p : fitted_parameters(fit.law, variables)) {
    metrics.set("parameter." + p.name, p.value);
    metrics.set("outside_range." + p.name, p.outside() ? 1 : 0);
  }
}

Chart loss_chart(const FitResult& fit, const FitVariables& variables, const std::string& title) {
  Chart chart;
  chart.title = title;
  chart.x_label = "roll-outs of the candidate";
  chart.y_label = "position mse up to the horizon (m^2)";
  chart.log_y = true;
  struct Line {
    Series series;
    int stage = -1;
    double best = 0;
  };
  std::map<int, Line> lines;
  // Stages follow each other along the axis, so that lines of one stage stand above each other.
  std::map<int, int> length;
  for (const FitRecord& r : fit.history) {
    length[r.stage] = std::max(length[r.stage], r.epoch + 1);
  }
  std::map<int, int> offset;
  int sum = 0;
  for (const auto& [stage, epochs] : length) {
    offset[stage] = sum;
    sum += epochs;
  }
  for (const FitRecord& r : fit.history) {
    Line& line = lines[r.candidate];
    if (line.stage != r.stage) line.best = std::numeric_limits<double>::infinity();
    line.stage = r.stage;
    line.best = std::min(line.best, r.mse);
    line.series.label = fmt::format("start {}", r.candidate);
    if (fit.determined) line.series.label += fmt::format(" ({})", variables.label(r.candidate));
    line.series.x.push_back(offset[r.stage] + r.epoch + 1);
    line.series.y.push_back(line.best);
  }
  for (auto& [start, line] : lines) chart.series.push_back(std::move(line.series));
  return chart;
}

ParticlePicture frames_picture(const std::vector<std::pair<std::string, const Trajectory*>>& rows,
                               int columns, bool clouds) {
  ParticlePicture picture;
  picture.columns = columns;
  picture.colour_label = kHeightInBody;
  for (const auto& [name, trajectory] : rows) {
    // The last row has all that may be hidden in the others.
    const Trajectory& last = *rows.back().second;
    const bool cloud = clouds && trajectory != &last;
    const Trajectory& whole = cloud || last.particles == trajectory->particles ? last : *trajectory;
    const std::vector<double> heights =
        heights_in_body({whole.positions(0), whole.positions(0) + 3 * whole.particles});
    for (int c = 0; c < columns; ++c) {
      const std::int64_t frame = (trajectory->frames - 1) * c / std::max(1, columns - 1);
      ParticlePanel panel;
      panel.caption = fmt::format("{} {:.0f} ms", name, 1e3 * trajectory->time[frame]);
      std::optional<kernels::NearestPoints> tree;
      if (cloud) tree.emplace(last.positions(frame), static_cast<std::size_t>(last.particles));
      for (std::int64_t p = 0; p < trajectory->particles; ++p) {
        const double* x = trajectory->positions(frame) + 3 * p;
        if (std::isnan(x[0])) continue;
        panel.x.insert(panel.x.end(), x, x + 3);
        panel.colour.push_back(heights[tree ? tree->nearest(x) : p]);
      }
      picture.panels.push_back(std::move(panel));
    }
  }
  return picture;
}

Playback fit_playback(const Inference& inference, const std::string& title) {
  const bool cloud = inference.seen.cloud > 0;
  const Trajectory seen = observed_trajectory(inference.seen);
  Trajectory fitted = inference.fitted;
  fitted.F = inference.deformation;
  const double wall = inference.seen.bound / double(inference.seen.grid);
  return {title,
          {motion_of("observed", inference.seen),
           cloud ? motion_of("fitted", fitted) : motion_of("fitted", fitted, "observed", seen)},
          {},
          wall,
          1 - wall};
}

std::string fit_fingerprint(const Observation& observation, const FitVariables& variables,
                            const std::string& text) {
  kernels::Hash hash;
  hash.add(observation.x);
  hash.add(observation.time);
  hash.add(observation.volume);
  hash.add(observation.body);
  hash.add(observation.tracers);
  hash.add(fmt::format("{} {} {} {} {} {} {}", observation.grid, observation.dt,
                       observation.gravity[0], observation.gravity[1], observation.gravity[2],
                       observation.walls, observation.bound));
  hash.add(std::vector<double>{observation.density, observation.noise,
                               double(observation.start_degree), double(observation.cloud)});
  hash.add(observation.cloud_distance);
  for (int i = 0; i < variables.starts(); ++i) hash.add(variables.start(i));
  add_weights(hash, variables.law(variables.start(0)));
  hash.add(text);
  return hash.text();
}

}  // namespace uniphy
