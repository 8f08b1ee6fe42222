#pragma once

#include <random>
#include <vector>

#include "ops/kernels/rollout/rollout.hpp"
#include "uniphy/inference/rigid_motion.hpp"
#include "uniphy/io/model_file.hpp"
#include "uniphy/io/observation.hpp"

namespace uniphy::testing {

struct ObservedScene {
  int side = 6;  ///< particles along a side of the box
  int grid = 16;
  double dt = 5e-4;
  int frames = 41;
  int every = 5;  ///< steps
  double box = 0.3;
  RigidMotion motion{{0.5, 0.36, 0.5}, {0.4, -1.5, -0.3}, {1.0, -2.0, 3.0}};
};

/// Positions of a box that falls to the floor, simulated in float64.
inline Observation observe(const kernels::LawDescription& law, const ObservedScene& scene = {}) {
  Observation o;
  o.grid = scene.grid;
  o.dt = scene.dt;
  o.particles = scene.side * scene.side * scene.side;
  o.frames = scene.frames;
  o.volume.assign(o.particles, std::pow(scene.box / scene.side, 3));
  std::vector<double> x;
  for (int i = 0; i < o.particles; ++i) {
    const int index[3] = {i % scene.side, i / scene.side % scene.side, i / scene.side / scene.side};
    for (int k = 0; k < 3; ++k) {
      x.push_back(scene.motion.centre[k] + scene.box * ((index[k] + 0.5) / scene.side - 0.5));
    }
  }
  kernels::GridSettings grid;
  grid.n = scene.grid;
  grid.dt = scene.dt;
  std::vector<double> mass = o.volume;
  for (double& m : mass) m *= o.density;
  const kernels::Rollout<double> rollout(grid, {{0, o.particles, kernels::make_law<double>(law)}},
                                         mass, o.volume);
  auto state = kernels::ParticleState<double>::undeformed(x, scene.motion.velocities(x));
  kernels::RunOptions<double> options;
  options.every = scene.every;
  options.on_frame = [&](std::ptrdiff_t step, const kernels::ParticleState<double>& at) {
    o.x.insert(o.x.end(), at.x.begin(), at.x.end());
    o.time.push_back(static_cast<double>(step) * scene.dt);
    return true;
  };
  rollout.run(state, static_cast<std::ptrdiff_t>(scene.frames - 1) * scene.every, options);
  return o;
}

inline kernels::LawDescription elastic_body(double mu = 2e4, double lambda = 3e4) {
  kernels::LawDescription law;
  law.mu = mu;
  law.lambda = lambda;
  return law;
}

/// A model of single layers whose latent code has a meaning: stress scale, strain scale, yield
/// strain and shear stiffness of an elastoplastic body with a little viscosity. Codes with a high
/// yield strain are called elastic, the others plasticine.
inline ModelFile readable_model(int codes = 8) {
  constexpr int kLatent = 4;
  const auto layer = [](int features, std::vector<double> bias) {
    kernels::MlpWeights::Layer l;
    l.in = features + kLatent;
    l.out = static_cast<int>(bias.size());
    l.weight.assign(static_cast<std::size_t>(l.in * l.out), 0.0);
    l.bias = std::move(bias);
    return l;
  };
  ModelFile model;
  kernels::LearnedLawWeights& w = model.weights;
  w.form = kernels::LawForm::isotropic;
  w.latent_size = kLatent;
  const kernels::NetworkShape shape = kernels::network_shape(w.form);
  auto caps =
      layer(shape.projection_in, {1.5, 100, 0, 0, 0});  // c₀, c₂ in units of the strain scale
  caps.weight[shape.projection_in + 2] = 2;
  w.projection.layers = {caps};
  auto stress = layer(shape.stress_in, {1.5, 0, 1.4, 0, 0.2, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  stress.weight[2 * stress.in + shape.stress_in + 3] = 1;
  w.stress.layers = {stress};
  std::mt19937 random(3);
  for (int i = 0; i < codes; ++i) {
    const auto draw = [&] { return static_cast<double>(random()) / 4294967296.0 - 0.5; };
    const double yield = i % 2 == 0 ? 1.5 : draw();
    for (const double z : {-0.4 + 0.8 * draw(), 0.5 * draw(), yield, draw()}) {
      model.latents.push_back(z);
    }
    model.materials.push_back(i % 2 == 0 ? "elastic" : "plasticine");
    model.parameters.push_back(no_parameters());
  }
  return model;
}

}  // namespace uniphy::testing
