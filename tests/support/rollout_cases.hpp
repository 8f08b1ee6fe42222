#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/laws/law_parameters.hpp"
#include "ops/rollout/rollout.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/law_cases.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::testing {

/// A small cube that falls on the floor while it turns.
struct RolloutScene {
  torch::Tensor x, v, C, F, mass, volume;
  torch::Tensor memory;  ///< undefined: zero
  ops::RolloutSettings settings;

  explicit RolloutScene(torch::ScalarType type = torch::kFloat64, int side = 5) {
    const std::int64_t P = std::int64_t(side) * side * side;
    const torch::Tensor i = torch::arange(P, torch::kFloat64);
    const torch::Tensor index = torch::stack(
        {(i / (side * side)).floor(), (i / side).floor().remainder(side), i.remainder(side)}, 1);
    const torch::Tensor r = ((index + 0.5) / side - 0.5) * 0.25;
    const torch::Tensor centre = torch::tensor({0.5, 0.3, 0.45}, torch::kFloat64);
    const torch::Tensor spin = torch::tensor({4.0, -2.0, 3.0}, torch::kFloat64).expand({P, 3});
    x = (centre + r).to(type);
    v = (torch::tensor({1.0, -3.0, -0.5}, torch::kFloat64) + torch::cross(spin, r, 1)).to(type);
    C = torch::zeros({P, 3, 3}, type);
    F = torch::eye(3, type).repeat({P, 1, 1});
    const double one = 0.25 * 0.25 * 0.25 / double(P);
    volume = torch::full({P}, one, type);
    mass = 1000 * volume;
    settings.steps = 50;
    settings.every = 10;
    settings.grid.dt = 2e-4;
  }
  ops::RolloutBody body(const kernels::LawDescription& law, const torch::Tensor& parameters) const {
    return {0, x.size(0), law, parameters};
  }
  ops::RolloutFrames run(const kernels::LawDescription& law,
                         const torch::Tensor& parameters) const {
    return ops::rollout(x, v, C, F, mass, volume, {body(law, parameters)}, settings, memory);
  }
};

/// Σ (x − x0)·w with fixed random w: the part of the positions that the motion made.
inline torch::Tensor loss_of(const torch::Tensor& frames) {
  torch::manual_seed(3);
  const torch::Tensor w = torch::randn(frames.sizes(), torch::kFloat64).to(frames.scalar_type());
  return ((frames - frames[0].detach()) * w).sum();
}

inline torch::Tensor parameters_of(const kernels::LawDescription& law) {
  return torch::tensor(kernels::parameter_values(law), torch::kFloat64);
}

struct RolloutMaterial {
  std::string name;
  kernels::LawDescription law;
  torch::Tensor parameters;
};

inline std::vector<RolloutMaterial> rollout_materials() {
  std::vector<RolloutMaterial> all;
  for (const kernels::LawId id : analytic_laws()) {
    kernels::LawDescription law = sample_law(id);
    // Bodies that yield within 50 steps, yet few particles stand close to the yield surface.
    if (is_plastic(id)) law.tau_y = 500;
    // A viscosity that shows within them, and a flow that begins smoothly where it yields.
    if (id == kernels::LawId::carreau) law.eta = 1000, law.eta_inf = 200;
    if (id == kernels::LawId::herschel_bulkley) law.n = 0.5, law.eta = 200;
    all.push_back({kernels::law_name(id), law, parameters_of(law)});
  }
  for (const auto form : {kernels::LawForm::isotropic, kernels::LawForm::published}) {
    kernels::LawDescription law;
    law.id = kernels::LawId::learned;
    auto weights = random_weights(form, 6, 16, 2, kernels::Activation::gelu, 5, 0.5);
    // Untrained, the published form adds noise to F in every step: keep it small enough to fly; and
    // the isotropic form switches between solid and fluid where it stands: keep its caps apart from
    // 0.
    kernels::MlpWeights::Layer& last = weights.projection.layers.back();
    const bool published = form == kernels::LawForm::published;
    for (double& w : last.weight) w *= published ? 1e-3 : 0.1;
    if (published) {
      for (double& b : last.bias) b *= 1e-3;
    } else {
      // A cap of less than a strain scale that hardly depends on the trace, and a return by a
      // twentieth a step: above the cap, and far from a fluid, throughout.
      last.bias = {0.7, 5, 0.02, 3.7, 0.1};
      weights.stress.layers.back().bias = {2, 0,  2,   0.5, 0.2, 1,    1,
                                           0, -1, 0.3, 0.2, 0.5, -0.2, 0.5};  // stiff: z shows
    }
    law.weights = std::make_shared<kernels::LearnedLawWeights>(weights);
    torch::manual_seed(11);
    all.push_back({kernels::form_name(form), law, 0.3 * torch::randn({6}, torch::kFloat64)});
  }
  return all;
}

/// The material with networks that do not see its state.
inline RolloutMaterial of_z_alone(RolloutMaterial m) {
  auto weights = *m.law.weights;
  const kernels::NetworkShape shape = kernels::network_shape(weights.form);
  const auto clear = [](kernels::MlpWeights::Layer& first, int features) {
    for (int o = 0; o < first.out; ++o)
      std::fill_n(first.weight.begin() + std::ptrdiff_t(o) * first.in, features, 0.0);
  };
  clear(weights.projection.layers.front(), shape.projection_in);
  clear(weights.stress.layers.front(), shape.stress_in);
  m.law.weights = std::make_shared<kernels::LearnedLawWeights>(weights);
  m.name += "_of_z_alone";
  return m;
}

/// Where a roll-out of this material starts. Those of learned laws are strained: the published form
/// is not smooth where singular values meet, and the isotropic one is to yield; so is cohesive
/// sand.
inline RolloutScene scene_of(const RolloutMaterial& m, torch::ScalarType type = torch::kFloat64,
                             int side = 5) {
  RolloutScene scene(type, side);
  if (m.law.id == kernels::LawId::learned || m.law.id == kernels::LawId::cohesive_sand) {
    scene.F = torch::diag(torch::tensor({1.2, 1.0, 0.8}, torch::kFloat64))
                  .repeat({scene.x.size(0), 1, 1})
                  .to(type);
  }
  if (kernels::law_has_memory(m.law.id)) {
    torch::manual_seed(13);
    scene.memory = (1e-4 * torch::rand({scene.x.size(0)}, torch::kFloat64)).to(type);
  }
  return scene;
}

/// The largest relative error, along four random directions in the numbers of each network, of the
/// gradient of one roll-out against central differences; infinite where there is nothing to find.
inline double rollout_weight_error(const RolloutMaterial& m) {
  const RolloutScene scene = scene_of(m);
  const ops::LearnedNetworks networks = ops::to_networks(*m.law.weights, torch::kFloat64);
  const auto run = [&](const ops::LearnedNetworks& n) {
    ops::RolloutBody body = scene.body(m.law, m.parameters);
    body.networks = n;
    return loss_of(ops::rollout(scene.x, scene.v, scene.C, scene.F, scene.mass, scene.volume,
                                {body}, scene.settings)
                       .x);
  };
  ops::LearnedNetworks leaf = networks;
  leaf.projection.numbers = networks.projection.numbers.clone().requires_grad_();
  leaf.stress.numbers = networks.stress.numbers.clone().requires_grad_();
  const auto g = torch::autograd::grad({run(leaf)}, {leaf.projection.numbers, leaf.stress.numbers});
  double largest = 0;
  torch::manual_seed(9);
  for (const int network : {0, 1}) {
    std::vector<double> found, expected;
    for (int repeat = 0; repeat < 4; ++repeat) {
      const torch::Tensor direction = torch::randn_like(g[network]);
      const auto value = [&](const std::vector<double>& t) {
        ops::LearnedNetworks moved = networks;
        ops::FlatLayers& layers = network == 0 ? moved.projection : moved.stress;
        layers.numbers = layers.numbers + t[0] * direction;
        return run(moved).item<double>();
      };
      found.push_back((direction * g[network]).sum().item<double>());
      expected.push_back(central_differences(value, {0}, {1e-5})[0]);
      if (expected.back() == 0) return INFINITY;
    }
    largest = std::max(largest, relative_error(found, expected));
  }
  return largest;
}

/// Relative errors of the gradients of one roll-out against central differences.
struct RolloutErrors {
  double velocity = 0;             ///< along four random directions
  std::vector<double> parameters;  ///< each parameter; z as a whole, of which an untrained law
                                   ///< hardly feels some coordinates
  std::vector<double> sizes;       ///< what the differences find, to see that none is zero
};

inline RolloutErrors rollout_errors(const RolloutMaterial& m) {
  RolloutScene scene = scene_of(m);
  scene.v.requires_grad_();
  const torch::Tensor parameters = m.parameters.clone().requires_grad_();
  loss_of(scene.run(m.law, parameters).x).backward();
  const torch::Tensor grad_v = scene.v.grad(), grad_p = parameters.grad();

  RolloutErrors errors;
  torch::manual_seed(4);
  std::vector<double> found, expected;
  for (int repeat = 0; repeat < 4; ++repeat) {
    const torch::Tensor direction = torch::randn(grad_v.sizes(), torch::kFloat64);
    const auto value = [&](const std::vector<double>& t) {
      RolloutScene moved = scene;
      moved.v = scene.v.detach() + t[0] * direction;
      return loss_of(moved.run(m.law, m.parameters).x).item<double>();
    };
    found.push_back((direction * grad_v).sum().item<double>());
    expected.push_back(central_differences(value, {0}, {1e-5})[0]);
  }
  errors.velocity = relative_error(found, expected);

  const bool learned = m.law.id == kernels::LawId::learned;
  const bool narrow = m.law.id == kernels::LawId::cohesive_sand;
  found.clear();
  expected.clear();
  for (std::int64_t k = 0; k < m.parameters.size(0); ++k) {
    const double at = m.parameters[k].item<double>();
    const auto value = [&](const std::vector<double>& p) {
      torch::Tensor moved = m.parameters.clone();
      moved[k] = p[0];
      return loss_of(scene.run(m.law, moved).x).item<double>();
    };
    // Narrow where many particles stand near a yield surface: each that crosses it within the step
    // is a kink.
    const double step = learned ? 1e-5 : (narrow ? 1e-5 : 1e-3) * at;
    const auto difference = central_differences(value, {at}, {step});
    errors.sizes.push_back(std::abs(difference[0]));
    found.push_back(grad_p[k].item<double>());
    expected.push_back(difference[0]);
    if (!learned) errors.parameters.push_back(relative_error({found.back()}, difference));
  }
  if (learned) errors.parameters.push_back(relative_error(found, expected));
  return errors;
}

}  // namespace uniphy::testing
