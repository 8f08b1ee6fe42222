#include "uniphy/stability/horizon_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/law_parameters.hpp"
#include "ops/kernels/rollout/lost_particle.hpp"
#include "uniphy/geometry/random.hpp"
#include "uniphy/scene/scene.hpp"
#include "uniphy/stability/stability_scenes.hpp"

namespace uniphy::stability {
namespace {

constexpr double kSide = 0.3;         ///< m, of the cube
constexpr std::int64_t kPerSide = 6;  ///< its particles, one a cell
/// A step inside of the kinks that were met (1e-7 of z), and what rounding leaves of its quotient.
constexpr double kClosest = 1e-8, kClosestNoise = 1e-2;

std::vector<double> loss_weights(std::int64_t particles, std::uint64_t seed) {
  UniformRandom random(seed);
  std::vector<double> w(static_cast<std::size_t>(3 * particles));
  for (double& each : w) each = random.between(-1, 1) / static_cast<double>(particles);
  return w;
}

double norm(const std::vector<double>& v) {
  double sum = 0;
  for (const double each : v) sum += each * each;
  return std::sqrt(sum);
}

/// The law with its first parameter p moved to p e^h; of a learned one z₀ to z₀ + h.
SceneDescription moved(SceneDescription scene, double h) {
  kernels::LawDescription& law = scene.bodies.front().law;
  std::vector<double> values = kernels::parameter_values(law);
  values[0] = law.id == kernels::LawId::learned ? values[0] + h : values[0] * std::exp(h);
  law = kernels::with_parameters(law, values.data());
  return scene;
}

double loss(const SceneDescription& scene, const std::vector<double>& w) {
  const PlacedScene placed = place_scene(scene);
  Scene<double> runnable = build_scene<double>(scene, placed);
  runnable.rollout.run(runnable.initial, placed.steps);
  double sum = 0;
  for (std::size_t k = 0; k < w.size(); ++k) sum += w[k] * runnable.initial.x[k];
  return sum;
}

struct Adjoint {
  double by_parameter = 0, growth = 0;
  bool finite = false;
};

template <class T>
Adjoint adjoint(const SceneDescription& scene, const std::vector<double>& w) {
  const PlacedScene placed = place_scene(scene);
  Scene<T> runnable = build_scene<T>(scene, placed);
  const std::size_t size = w.size();
  std::vector<T> frames(2 * size), grad(2 * size, T(0));
  for (std::size_t k = 0; k < size; ++k) grad[size + k] = T(w[k]);
  kernels::RolloutTape<T> tape;
  runnable.rollout.record(runnable.initial, placed.steps, placed.steps, frames.data(), nullptr,
                          &tape);
  const kernels::RolloutGradient<T> g = runnable.rollout.adjoint(tape, grad.data(), nullptr);
  const kernels::LawDescription& law = scene.bodies.front().law;
  Adjoint out;
  out.by_parameter = static_cast<double>(g.parameters[0][0]);
  if (law.id != kernels::LawId::learned) out.by_parameter *= kernels::parameter_values(law)[0];
  const std::vector<double> at_start(g.state.x.begin(), g.state.x.end());
  out.growth = norm(at_start) / norm(w);
  out.finite = std::isfinite(out.growth) && std::isfinite(out.by_parameter);
  return out;
}

void measure(const SceneDescription& scene, bool single, std::uint64_t seed, Cell& out) {
  out.deciding = "gradient_error";
  const std::vector<double> w = loss_weights(kPerSide * kPerSide * kPerSide, seed);
  try {
    const Adjoint a = single ? adjoint<float>(scene, w) : adjoint<double>(scene, w);
    const auto quotient = [&](double h) {
      return (loss(moved(scene, h), w) - loss(moved(scene, -h), w)) / (2 * h);
    };
    const double wide = quotient(1e-4), narrow = quotient(1e-5);
    const auto error_of = [&](double quotient_of_loss) {
      return std::abs(a.by_parameter - quotient_of_loss) / std::abs(quotient_of_loss);
    };
    const double limit = single ? kLongTolerance32 : kLongTolerance64;
    const bool agree = std::abs(wide - narrow) <= kChaos * std::abs(narrow);
    double error = error_of(narrow);
    bool local = false;
    if (!agree || error > limit) {
      const double closest = quotient(kClosest);
      out.set("quotient_closest", closest);
      local = error_of(closest) <= std::max(limit, kClosestNoise);
      if (local) error = error_of(closest);
    }
    const bool chaos = !agree && !local;
    out.set("adjoint_growth", a.growth);
    out.set("gradient", a.by_parameter);
    out.set("quotient_wide", wide);
    out.set("quotient_narrow", narrow);
    out.set("chaos", chaos ? 1 : 0);
    out.set("local", local ? 1 : 0);
    if (!chaos) out.set("gradient_error", error);
    out.verdict = a.finite && (chaos || local || error <= limit) ? Verdict::holds : Verdict::fails;
    if (out.verdict == Verdict::holds) return;
    out.failure.cause =
        a.finite ? fmt::format("the adjoint differs from both quotients by {:.2g} of them", error)
                 : "the adjoint is not finite";
  } catch (const kernels::LostParticle& lost) {
    out.verdict = Verdict::stops;
    out.failure = {lost.step(), lost.particle(), lost.what()};
  } catch (const Error& error) {
    out.verdict = Verdict::stops;
    out.failure = {-1, -1, error.what()};
  }
}

}  // namespace

Plan horizon_cells(const StabilityOptions& o, const Subjects& all) {
  Plan plan;
  for (const Subject& subject : all.materials) {
    if (subject.material == "newtonian" || subject.material == "non_newtonian") continue;
    for (const char* method : {"analytic", "isotropic"}) {
      if (!o.has_method(method)) continue;
      for (const std::int64_t steps : o.horizons) {
        SceneDescription scene = cube_on_floor(subject.law(method), 10, steps, kSide);
        scene.dt = place_scene(scene).grid.dt;  // the same for every parameter
        for (const bool single : {false, true}) {
          PlannedCell cell{"horizons",
                           method,
                           fmt::format("{} {} steps {}", subject.material, steps,
                                       single ? "float32" : "float64"),
                           fmt::format("{} {}", o.seed, all.fingerprint),
                           {}};
          cell.measure = [scene, single, seed = o.seed + 6](Cell& out) {
            measure(scene, single, seed, out);
          };
          plan.push_back(std::move(cell));
        }
      }
    }
  }
  return plan;
}

}  // namespace uniphy::stability
