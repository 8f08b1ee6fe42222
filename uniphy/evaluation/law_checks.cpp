#include "uniphy/evaluation/law_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/statistics.hpp"
#include "uniphy/data/random_rotation.hpp"
#include "uniphy/data/random_streams.hpp"
#include "uniphy/data/trajectory_setup.hpp"
#include "uniphy/geometry/shape_catalogue.hpp"
#include "uniphy/report/for_each_with_progress.hpp"

namespace uniphy {
namespace {

using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Map = Eigen::Map<Matrix>;
using ConstMap = Eigen::Map<const Matrix>;

constexpr double kStressFloor = 1e-2;  ///< of the trajectory's RMS, see FrameIndifference

void raise(double& worst, double value) {
  if (!std::isnan(worst) && !(value <= worst)) worst = value;
}

struct Answers {
  std::vector<double> F_proj, tau;
};

Answers ask(const kernels::LawKernel<double>& law, double dt, const std::vector<double>& F,
            const std::vector<double>& C) {
  const auto count = static_cast<std::ptrdiff_t>(F.size() / 9);
  Answers a{std::vector<double>(F.size()), std::vector<double>(F.size())};
  law.evaluate(count, dt, {F.data(), 9, 1}, {C.data(), 9, 1}, {a.F_proj.data(), 9, 1},
               {a.tau.data(), 9, 1});
  return a;
}

FrameIndifference of_trajectory(const Dataset& data, std::size_t i,
                                const kernels::LawDescription& description, std::uint64_t seed) {
  const auto law = kernels::make_law<double>(description);
  const std::int64_t begin = 9 * data.first[i], end = 9 * data.first[i + 1];
  const auto part = [&](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + begin, all.begin() + end);
  };
  const std::vector<double> F = part(data.samples.F), C = part(data.samples.C);
  std::vector<double> turned_F(F.size()), turned_C(C.size());
  std::vector<Matrix> rotations;
  UniformRandom random(scramble(scramble(seed) ^ i));
  for (std::size_t k = 0; k < F.size(); k += 9) {
    const Matrix Q = random_rotation(random);
    Map(&turned_F[k]).noalias() = Q * ConstMap(&F[k]);
    Map(&turned_C[k]).noalias() = Q * ConstMap(&C[k]) * Q.transpose();
    rotations.push_back(Q);
  }
  const double dt = data.trajectories[i].dt;
  const Answers plain = ask(*law, dt, F, C), turned = ask(*law, dt, turned_F, turned_C);

  const double square =
      kernels::sum_of_squares(plain.tau.data(), static_cast<std::ptrdiff_t>(plain.tau.size()));
  const double rms = std::sqrt(square / std::max(1.0, static_cast<double>(rotations.size())));
  FrameIndifference worst;
  for (std::size_t s = 0; s < rotations.size(); ++s) {
    const Matrix& Q = rotations[s];
    const ConstMap tau(&plain.tau[9 * s]), turned_tau(&turned.tau[9 * s]);
    const double size = std::max({tau.norm(), kStressFloor * rms, 1e-300});
    const double of_tau = (turned_tau - Q * tau * Q.transpose()).norm() / size;
    const ConstMap G(&plain.F_proj[9 * s]), turned_G(&turned.F_proj[9 * s]);
    const Matrix b = G * G.transpose();
    const double of_b = (turned_G * turned_G.transpose() - Q * b * Q.transpose()).norm() / b.norm();
    worst.include({of_tau, of_b});
  }
  return worst;
}

double drift(const kernels::LawDescription& law, const RestOptions& o) {
  SceneDescription scene;
  scene.grid = o.grid;
  std::fill_n(scene.grid.gravity, 3, 0.0);
  scene.steps = o.steps;
  BodyDescription body;
  body.name = "body at rest";
  body.solid = make_shape("sphere");
  body.filling.kind = Filling::Kind::lattice;
  body.filling.count = o.particles;
  body.placement.size = 0.3;
  body.density = o.density;
  body.law = law;
  scene.bodies.push_back(body);
  scene.dt = std::min(
      o.dt, stable_time_step(estimate_stiffness(law), o.density, o.grid.dx(), 0, kFixedStepSafety));
  const PlacedScene placed = place_scene(scene);
  Scene<double> runnable = build_scene<double>(scene, placed);
  double square = 0;
  kernels::RunOptions<double> run;
  run.every = 1;
  run.on_frame = [&](std::ptrdiff_t, const kernels::ParticleState<double>& state) {
    for (std::size_t k = 0; k < state.x.size(); k += 3) {
      double moved = 0;
      for (std::size_t axis = k; axis < k + 3; ++axis) {
        moved += (state.x[axis] - placed.x[axis]) * (state.x[axis] - placed.x[axis]);
      }
      square = std::max(square, moved);
    }
    return true;
  };
  runnable.rollout.run(runnable.initial, placed.steps, run);
  return std::sqrt(square);
}

}  // namespace

void FrameIndifference::include(const FrameIndifference& other) {
  raise(stress, other.stress);
  raise(projection, other.projection);
}

FrameIndifference frame_indifference(const Dataset& data,
                                     const std::vector<kernels::LawDescription>& laws,
                                     std::uint64_t seed) {
  std::vector<FrameIndifference> of(laws.size());
  for_each_with_progress("turn states", "trajectories", static_cast<std::int64_t>(laws.size()),
                         [&](std::int64_t i) {
                           of[i] = of_trajectory(data, static_cast<std::size_t>(i), laws[i], seed);
                         });
  FrameIndifference worst;
  for (const FrameIndifference& one : of) worst.include(one);
  return worst;
}

std::vector<double> rest_drifts(const std::vector<kernels::LawDescription>& laws,
                                const RestOptions& options) {
  std::vector<double> drifts(laws.size(), 0);
  for_each_with_progress(
      "rest", "codes", static_cast<std::int64_t>(laws.size()), [&](std::int64_t i) {
        try {
          drifts[i] = drift(laws[i], options);
        } catch (const Error& error) {
          drifts[i] = 1;
          std::fprintf(stderr, "at rest, code %lld: %s\n", static_cast<long long>(i), error.what());
        }
      });
  return drifts;
}

}  // namespace uniphy
