#include "ops/rollout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>
#include <torch/torch.h>

#include <functional>
#include <string>
#include <vector>

#include "ops/kernels/error.hpp"
#include "ops/reference/mpm_step.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/law_cases.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::ops {
namespace {

using kernels::LawDescription;
using kernels::LawId;
using testing::central_differences;
using testing::relative_error;
using torch::Tensor;

/// A small cube that falls on the floor while it turns.
struct Scene {
  Tensor x, v, C, F, mass, volume;
  RolloutSettings settings;

  explicit Scene(torch::ScalarType type = torch::kFloat64, int side = 5) {
    const std::int64_t P = std::int64_t(side) * side * side;
    const Tensor i = torch::arange(P, torch::kFloat64);
    const Tensor index = torch::stack(
        {(i / (side * side)).floor(), (i / side).floor().remainder(side), i.remainder(side)}, 1);
    const Tensor r = ((index + 0.5) / side - 0.5) * 0.25;
    const Tensor centre = torch::tensor({0.5, 0.3, 0.45}, torch::kFloat64);
    const Tensor spin = torch::tensor({4.0, -2.0, 3.0}, torch::kFloat64).expand({P, 3});
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
  RolloutBody body(const LawDescription& law, const Tensor& parameters) const {
    return {0, x.size(0), law, parameters};
  }
  RolloutFrames run(const LawDescription& law, const Tensor& parameters) const {
    return rollout(x, v, C, F, mass, volume, {body(law, parameters)}, settings);
  }
};

/// Σ (x − x0)·w with fixed random w: the part of the positions that the motion made.
Tensor loss_of(const Tensor& frames) {
  torch::manual_seed(3);
  const Tensor w = torch::randn(frames.sizes(), torch::kFloat64).to(frames.scalar_type());
  return ((frames - frames[0].detach()) * w).sum();
}

Tensor parameters_of(const LawDescription& law) {
  std::vector<double> values;
  for (const std::string& name : kernels::parameter_names(law.id)) {
    values.push_back(name == "mu"       ? law.mu
                     : name == "lambda" ? law.lambda
                     : name == "tau_y"  ? law.tau_y
                     : name == "theta"  ? law.theta
                                        : law.eta);
  }
  return torch::tensor(values, torch::kFloat64);
}

struct Material {
  std::string name;
  LawDescription law;
  Tensor parameters;
};

std::vector<Material> materials() {
  std::vector<Material> all;
  for (const LawId id : testing::analytic_laws()) {
    LawDescription law = testing::sample_law(id);
    // Bodies that yield within 50 steps, yet few particles stand close to the yield surface.
    if (testing::is_plastic(id)) law.tau_y = 500;
    all.push_back({kernels::law_name(id), law, parameters_of(law)});
  }
  for (const auto form : {kernels::LawForm::isotropic, kernels::LawForm::seed}) {
    LawDescription law;
    law.id = LawId::learned;
    auto weights = testing::random_weights(form, 6, 16, 2, kernels::Activation::gelu, 5, 0.5);
    // Untrained, the seed form adds noise to F in every step: keep it small enough to fly; and the
    // isotropic form switches between solid and fluid where it stands: make it yield early instead.
    kernels::MlpWeights::Layer& last = weights.projection.layers.back();
    const bool seed = form == kernels::LawForm::seed;
    for (double& w : last.weight) w *= seed ? 1e-3 : 0.1;
    if (seed)
      for (double& b : last.bias) b *= 1e-3;
    else {
      last.bias = {0.5, 5, 0.3, 0.5};
      weights.stress.layers.back().bias = {2, 0, 2, 0, 0.2, 1, 1, 0};  // stiff: z shows
    }
    law.weights = std::make_shared<kernels::LearnedLawWeights>(weights);
    torch::manual_seed(11);
    all.push_back({kernels::form_name(form), law, 0.3 * torch::randn({6}, torch::kFloat64)});
  }
  return all;
}

class RolloutOfMaterial : public ::testing::TestWithParam<int> {};

TEST_P(RolloutOfMaterial, GradientsAgreeWithCentralDifferences) {
  const Material m = materials()[GetParam()];
  Scene scene;
  if (m.name == "seed") {
    // The seed form is not smooth where singular values meet: start with some apart.
    scene.F = torch::diag(torch::tensor({1.2, 1.0, 0.8}, torch::kFloat64))
                  .repeat({scene.x.size(0), 1, 1});
  }
  scene.v.requires_grad_();
  const Tensor parameters = m.parameters.clone().requires_grad_();
  loss_of(scene.run(m.law, parameters).x).backward();
  const Tensor grad_v = scene.v.grad(), grad_p = parameters.grad();

  torch::manual_seed(4);
  std::vector<double> found, expected;
  for (int repeat = 0; repeat < 4; ++repeat) {
    const Tensor direction = torch::randn(grad_v.sizes(), torch::kFloat64);
    const auto value = [&](const std::vector<double>& t) {
      Scene moved = scene;
      moved.v = scene.v.detach() + t[0] * direction;
      return loss_of(moved.run(m.law, m.parameters).x).item<double>();
    };
    found.push_back((direction * grad_v).sum().item<double>());
    expected.push_back(central_differences(value, {0}, {1e-5})[0]);
  }
  EXPECT_LE(relative_error(found, expected), 1e-6) << "v";

  const bool learned = m.law.id == LawId::learned;
  found.clear();
  expected.clear();
  for (std::int64_t k = 0; k < m.parameters.size(0); ++k) {
    const double at = m.parameters[k].item<double>();
    const auto value = [&](const std::vector<double>& p) {
      Tensor moved = m.parameters.clone();
      moved[k] = p[0];
      return loss_of(scene.run(m.law, moved).x).item<double>();
    };
    found.push_back(grad_p[k].item<double>());
    expected.push_back(central_differences(value, {at}, {1e-3 * (learned ? 1 : at)})[0]);
    EXPECT_NE(expected.back(), 0);
    if (!learned) {
      EXPECT_LE(relative_error({found.back()}, {expected.back()}), 1e-6) << "parameter " << k;
    }
  }
  // z as a whole: some of its coordinates hardly move an untrained law.
  if (learned) {
    EXPECT_LE(relative_error(found, expected), 1e-6) << "z";
  }
}
INSTANTIATE_TEST_SUITE_P(, RolloutOfMaterial, ::testing::Range(0, 9),
                         [](const auto& info) { return materials()[info.param].name; });

TEST(Rollout, AgreesWithTheReferenceInValueAndGradient) {
  Scene scene;
  scene.settings.steps = 12;
  scene.settings.every = 4;
  scene.settings.velocities = true;
  torch::manual_seed(2);
  scene.F = scene.F + 0.02 * torch::randn_like(scene.F);
  scene.C = 3 * torch::randn_like(scene.C);
  const LawDescription law = testing::sample_law(LawId::elastic);
  const Tensor p = parameters_of(law).requires_grad_();
  const std::vector<Tensor> leaves{scene.x.requires_grad_(), scene.v.requires_grad_(),
                                   scene.C.requires_grad_(), scene.F.requires_grad_(), p};
  const RolloutFrames found = scene.run(law, p);

  const reference::TensorLaw neo_hookean = [&](const Tensor& F, const Tensor&) {
    const Tensor I = torch::eye(3, torch::kFloat64);
    const Tensor log_J = torch::linalg_det(F).log().view({-1, 1, 1});
    return std::pair{F, p[0] * torch::matmul(F, F.transpose(1, 2)) + (p[1] * log_J - p[0]) * I};
  };
  reference::MpmState state{scene.x, scene.v, scene.C, scene.F};
  std::vector<Tensor> x{state.x}, v{state.v};
  for (int step = 1; step <= 12; ++step) {
    state = reference::mpm_step(state, scene.mass, scene.volume, neo_hookean, scene.settings.grid);
    if (step % 4 == 0) x.push_back(state.x), v.push_back(state.v);
  }
  const Tensor expected_x = torch::stack(x), expected_v = torch::stack(v);
  EXPECT_LE((found.x - expected_x).abs().max().item<double>(), 1e-13);
  EXPECT_LE((found.v - expected_v).abs().max().item<double>(), 1e-10);

  const auto both = [](const Tensor& a, const Tensor& b) { return loss_of(a) + 0.01 * loss_of(b); };
  const auto g = torch::autograd::grad({both(found.x, found.v)}, leaves);
  const auto e = torch::autograd::grad({both(expected_x, expected_v)}, leaves);
  const char* names[] = {"x", "v", "C", "F", "parameters"};
  for (int i = 0; i < 5; ++i) {
    EXPECT_GT(e[i].norm().item<double>(), 0) << names[i];
    EXPECT_LE(((g[i] - e[i]).norm() / e[i].norm()).item<double>(), 1e-10) << names[i];
  }
}

TEST(Rollout, TwoBodiesEachTakeTheirGradient) {
  Scene scene;
  const LawDescription soft = testing::sample_law(LawId::elastic);
  const LawDescription fluid = testing::sample_law(LawId::newtonian);
  const Tensor a = parameters_of(soft).to(torch::kFloat32).requires_grad_();
  const Tensor b = parameters_of(fluid).requires_grad_();
  std::vector<RolloutBody> bodies{{0, 60, soft, a}, {60, 125, fluid, b}};
  const auto run = [&] {
    return rollout(scene.x, scene.v, {}, {}, scene.mass, scene.volume, bodies, scene.settings).x;
  };
  const auto g = torch::autograd::grad({loss_of(run())}, {a, b});
  EXPECT_EQ(g[0].scalar_type(), torch::kFloat32);
  EXPECT_EQ(g[1].scalar_type(), torch::kFloat64);
  for (const int k : {0, 1}) {
    const auto value = [&](const std::vector<double>& t) {
      Tensor moved = b.detach().clone();
      moved[k] = t[0];
      bodies[1].parameters = moved;
      return loss_of(run()).item<double>();
    };
    const double at = b[k].item<double>();
    const auto expected = central_differences(value, {at}, {1e-4 * at});
    EXPECT_LE(relative_error({g[1][k].item<double>()}, expected), 1e-6);
  }
}

TEST(Rollout, SameBitsOnOneThreadAndOnTwo) {
  const int before = omp_get_max_threads();
  for (const auto type : {torch::kFloat32, torch::kFloat64}) {
    for (const Material& m : materials()) {
      std::vector<Tensor> results[2];
      for (const int threads : {1, 2}) {
        omp_set_num_threads(threads);
        Scene scene(type, 8);
        scene.v.requires_grad_();
        const Tensor p = m.parameters.clone().requires_grad_();
        const Tensor frames = scene.run(m.law, p).x;
        loss_of(frames).backward();
        results[threads - 1] = {frames, scene.v.grad(), p.grad()};
      }
      for (int i = 0; i < 3; ++i) {
        EXPECT_TRUE(torch::equal(results[0][i], results[1][i])) << m.name << " " << type << i;
      }
    }
  }
  omp_set_num_threads(before);
}

TEST(Rollout, UndefinedGradientsStayUndefinedAndConstantsNeedNoTape) {
  Scene scene;
  const LawDescription law = testing::sample_law(LawId::elastic);
  const Tensor p = parameters_of(law).requires_grad_();
  scene.settings.velocities = true;
  loss_of(scene.run(law, p).v).backward();  // x is not used
  EXPECT_TRUE(p.grad().defined());
  for (const Tensor& t : {scene.x, scene.v, scene.C, scene.F}) EXPECT_FALSE(t.grad().defined());
  EXPECT_FALSE(scene.run(law, {}).x.requires_grad());
  {
    torch::NoGradGuard off;
    EXPECT_FALSE(scene.run(law, p).x.requires_grad());
  }
  // Two roll-outs at once do not share anything.
  const Tensor one = scene.run(law, p).x, two = scene.run(law, 2 * p).x;
  const Tensor g1 = torch::autograd::grad({loss_of(one)}, {p})[0];
  const Tensor g2 = torch::autograd::grad({loss_of(two)}, {p})[0];
  const Tensor again = torch::autograd::grad({loss_of(scene.run(law, p).x)}, {p})[0];
  EXPECT_TRUE(torch::equal(g1, again));
  EXPECT_FALSE(torch::equal(g1, g2));
}

TEST(Rollout, ErrorsNameTheArgument) {
  const Scene good;
  const LawDescription law = testing::sample_law(LawId::elastic);
  const auto message = [&](const std::function<void(Scene&, RolloutBody&)>& spoil) -> std::string {
    Scene s;
    RolloutBody body = s.body(law, {});
    spoil(s, body);
    try {
      rollout(s.x, s.v, s.C, s.F, s.mass, s.volume, {body}, s.settings);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  using ::testing::HasSubstr;
  const auto single = [](const Tensor& t) { return t.to(torch::kFloat32); };
  EXPECT_EQ(message([](Scene&, RolloutBody&) {}), "no error");
  EXPECT_EQ(message([](Scene& s, RolloutBody&) { s.x = s.x.narrow(1, 0, 2); }),
            "rollout: x0: expected [any, 3] Double on cpu, found [125, 2] Double on cpu");
  EXPECT_THAT(message([](Scene& s, RolloutBody&) { s.x = Tensor(); }),
              HasSubstr("x0: expected a Float"));
  EXPECT_THAT(message([&](Scene& s, RolloutBody&) { s.v = single(s.v); }),
              HasSubstr("v0: expected [125, 3] Double on cpu, found [125, 3] Float"));
  EXPECT_THAT(message([&](Scene& s, RolloutBody&) { s.C = s.C[0]; }), HasSubstr("C0: expected"));
  EXPECT_THAT(message([&](Scene& s, RolloutBody&) { s.F = s.F[0]; }), HasSubstr("F0: expected"));
  EXPECT_THAT(message([&](Scene& s, RolloutBody&) { s.mass = Tensor(); }),
              HasSubstr("mass: expected"));
  EXPECT_THAT(message([&](Scene& s, RolloutBody&) { s.volume = single(s.volume); }),
              HasSubstr("volume: expected"));
  EXPECT_THAT(message([&](Scene& s, RolloutBody&) { s.settings.every = 0; }),
              HasSubstr("every >= 1"));
  EXPECT_THAT(message([](Scene&, RolloutBody& b) { b.parameters = torch::ones({3}); }),
              HasSubstr("parameters of body 0: expected [2] Float on cpu, found [3] Float"));
  EXPECT_THAT(message([](Scene&, RolloutBody& b) { b.end = 100; }), HasSubstr("mass"));
  EXPECT_THAT(message([](Scene& s, RolloutBody&) { s.x = s.x + 0.4; }),
              HasSubstr("placed too close"));
}

}  // namespace
}  // namespace uniphy::ops
