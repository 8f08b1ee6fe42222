#include "ops/rollout/rollout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <functional>
#include <string>
#include <vector>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/reference/mpm_step.hpp"
#include "tests/support/rollout_cases.hpp"

namespace uniphy::ops {
namespace {

using kernels::LawDescription;
using kernels::LawId;
using torch::Tensor;
using namespace testing;

class RolloutOfMaterial : public ::testing::TestWithParam<int> {};

TEST_P(RolloutOfMaterial, GradientsAgreeWithCentralDifferences) {
  const RolloutErrors errors = rollout_errors(rollout_materials()[GetParam()]);
  EXPECT_LE(errors.velocity, 1e-6) << "v";
  for (const double size : errors.sizes) EXPECT_NE(size, 0);
  for (std::size_t k = 0; k < errors.parameters.size(); ++k)
    EXPECT_LE(errors.parameters[k], 1e-6) << "parameter " << k;
}
INSTANTIATE_TEST_SUITE_P(, RolloutOfMaterial, ::testing::Range(0, 14),
                         [](const auto& info) { return rollout_materials()[info.param].name; });

TEST(Rollout, AgreesWithTheReferenceInValueAndGradient) {
  RolloutScene scene;
  scene.settings.steps = 12;
  scene.settings.every = 4;
  scene.settings.velocities = true;
  torch::manual_seed(2);
  scene.F = scene.F + 0.02 * torch::randn_like(scene.F);
  scene.C = 3 * torch::randn_like(scene.C);
  const LawDescription law = sample_law(LawId::elastic);
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
  RolloutScene scene;
  const LawDescription soft = sample_law(LawId::elastic);
  const LawDescription fluid = sample_law(LawId::newtonian);
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

/// The scene with tracers of its own after the body's particles.
struct TracedScene : RolloutScene {
  Tensor tracers =
      torch::tensor({{0.52, 0.3, 0.45}, {0.41, 0.2, 0.36}, {0.58, 0.35, 0.5}}, torch::kFloat64);

  RolloutFrames run(const LawDescription& law, const Tensor& parameters, const Tensor& start,
                    const Tensor& velocity) const {
    const std::int64_t P = x.size(0), all = P + start.size(0);
    RolloutBody points;
    points.begin = P, points.end = all, points.tracers = true;
    const auto zeros = [&] { return torch::zeros({start.size(0)}, torch::kFloat64); };
    return rollout(torch::cat({x, start}), torch::cat({velocity, torch::zeros_like(start)}), {}, {},
                   torch::cat({mass, zeros()}), torch::cat({volume, zeros()}),
                   {body(law, parameters), points}, settings);
  }
};

TEST(Rollout, TracersMoveWithTheGridAndChangeNothing) {
  TracedScene scene;
  const LawDescription law = sample_law(LawId::elastic);
  // A tracer that stands where a particle does moves like it.
  const Tensor start = torch::cat({scene.tracers, scene.x.slice(0, 7, 8)});
  const Tensor x = scene.run(law, parameters_of(law), start, scene.v).x;
  const std::int64_t P = scene.x.size(0);
  EXPECT_TRUE(torch::equal(x.slice(1, 0, P), scene.RolloutScene::run(law, {}).x));
  EXPECT_LE((x.select(1, P + 3) - x.select(1, 7)).abs().max().item<double>(), 1e-15);
  EXPECT_GE((x[-1] - x[0]).slice(0, P).norm(2, 1).min().item<double>(), 1e-2);
}

TEST(Rollout, TracersHaveNoMassAndComeLast) {
  TracedScene scene;
  const LawDescription law = sample_law(LawId::elastic);
  const std::int64_t P = scene.x.size(0);
  const auto message = [&](std::vector<RolloutBody> bodies) {
    try {
      rollout(scene.x, scene.v, {}, {}, scene.mass, scene.volume, bodies, scene.settings);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  RolloutBody front, points;
  front.begin = 0, front.end = P - 1, front.law = law;
  points.begin = P - 1, points.end = P, points.tracers = true;
  EXPECT_THAT(message({front, points}),
              ::testing::HasSubstr("expected mass 0 and volume 0 of particle 124, a tracer"));
  points.begin = 0, points.end = 1;
  front.begin = 1, front.end = P;
  EXPECT_THAT(
      message({points, front}),
      ::testing::HasSubstr("expected tracers after all material, found material in body 1"));
  points.end = P;
  EXPECT_THAT(message({points}), ::testing::HasSubstr("expected at least one of material"));
}

TEST(Rollout, GradientsOfTracersAgreeWithCentralDifferences) {
  TracedScene scene;
  const LawDescription law = sample_law(LawId::elastic);
  const Tensor p = parameters_of(law);
  const auto loss = [&](const Tensor& parameters, const Tensor& start, const Tensor& v) {
    const Tensor x = scene.run(law, parameters, start, v).x.slice(1, scene.x.size(0));
    return (x * torch::sin(torch::arange(x.numel(), torch::kFloat64).view_as(x))).sum();
  };
  const std::vector<Tensor> leaves{p.clone().requires_grad_(),
                                   scene.tracers.clone().requires_grad_(),
                                   scene.v.clone().requires_grad_()};
  const auto g = torch::autograd::grad({loss(leaves[0], leaves[1], leaves[2])}, leaves);
  torch::manual_seed(5);
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const Tensor direction = torch::randn_like(g[i]) * (i == 0 ? p : torch::ones({}));
    const auto value = [&](const std::vector<double>& t) {
      std::vector<Tensor> at;
      for (std::size_t k = 0; k < leaves.size(); ++k)
        at.push_back(k == i ? leaves[k].detach() + t[0] * direction : leaves[k].detach());
      return loss(at[0], at[1], at[2]).item<double>();
    };
    EXPECT_LE(relative_error({(direction * g[i]).sum().item<double>()},
                             central_differences(value, {0}, {i == 0 ? 1e-3 : 1e-5})),
              1e-6)
        << i;
  }
}

TEST(Rollout, SameBitsOnOneThreadAndOnTwo) {
  const int before = omp_get_max_threads();
  for (const auto type : {torch::kFloat32, torch::kFloat64}) {
    for (const RolloutMaterial& m : rollout_materials()) {
      std::vector<Tensor> results[2];
      for (const int threads : {1, 2}) {
        omp_set_num_threads(threads);
        RolloutScene scene(type, 8);
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

std::vector<RolloutMaterial> learned_materials() {
  std::vector<RolloutMaterial> all;
  for (const RolloutMaterial& m : rollout_materials()) {
    if (m.law.id != LawId::learned) continue;
    all.push_back(m);
    if (m.law.weights->form == kernels::LawForm::isotropic) all.push_back(of_z_alone(m));
  }
  return all;
}

class RolloutOfNetworks : public ::testing::TestWithParam<int> {
 protected:
  /// A roll-out of scene's particles, the first `cut` as a body of their own, with the same
  /// networks.
  static Tensor run(const RolloutScene& s, const RolloutMaterial& m,
                    const LearnedNetworks& networks, const Tensor& z, std::int64_t cut = 0) {
    RolloutBody body = s.body(m.law, z), other = body;
    body.networks = other.networks = networks;
    body.begin = other.end = cut;
    std::vector<RolloutBody> bodies{body};
    if (cut > 0) bodies.insert(bodies.begin(), other);
    return rollout(s.x, s.v, s.C, s.F, s.mass, s.volume, bodies, s.settings).x;
  }
  static LearnedNetworks leaves(const RolloutMaterial& m, torch::ScalarType type) {
    LearnedNetworks n = to_networks(*m.law.weights, type);
    n.projection.numbers.requires_grad_();
    n.stress.numbers.requires_grad_();
    return n;
  }
};

TEST_P(RolloutOfNetworks, WeightGradientsAgreeWithCentralDifferences) {
  EXPECT_LE(rollout_weight_error(learned_materials()[GetParam()]), 1e-6);
}

TEST_P(RolloutOfNetworks, SameBitsTogetherApartAndOnOneThreadAndOnTwo) {
  const RolloutMaterial m = learned_materials()[GetParam()];
  const int before = omp_get_max_threads();
  for (const auto type : {torch::kFloat32, torch::kFloat64}) {
    RolloutScene scene = scene_of(m, type, 12);  // 27 chunks: running sums of two and of one
    scene.settings.steps = 40;                   // more than a segment
    scene.v.requires_grad_();
    const Tensor z = m.parameters.clone().requires_grad_();
    const LearnedNetworks n = leaves(m, type);
    const std::vector<Tensor> all{scene.v, z, n.projection.numbers, n.stress.numbers};
    const auto gradients = [&](const std::vector<Tensor>& of) {
      return torch::autograd::grad({loss_of(run(scene, m, n, z))}, of);
    };
    omp_set_num_threads(1);
    const auto one = gradients(all);
    omp_set_num_threads(2);
    const auto two = gradients(all);
    for (std::size_t k = 0; k < all.size(); ++k) {
      EXPECT_GT(one[k].abs().max().item<double>(), 0) << k;
      EXPECT_TRUE(torch::equal(one[k], two[k])) << type << k;
      EXPECT_TRUE(torch::equal(gradients({all[k]})[0], two[k])) << type << k;
    }
  }
  omp_set_num_threads(before);
}

TEST_P(RolloutOfNetworks, BodiesThatShareThemAddTheirGradients) {
  const RolloutMaterial m = learned_materials()[GetParam()];
  const RolloutScene scene = scene_of(m);
  const LearnedNetworks n = leaves(m, torch::kFloat64);
  const auto gradients = [&](std::int64_t cut) {
    return torch::autograd::grad({loss_of(run(scene, m, n, m.parameters, cut))},
                                 {n.projection.numbers, n.stress.numbers});
  };
  const auto one = gradients(0), two = gradients(70);
  for (const int k : {0, 1})
    EXPECT_LE(((one[k] - two[k]).norm() / one[k].norm()).item<double>(), 1e-9) << k;
}

TEST_P(RolloutOfNetworks, OnlyWhatIsAskedForHasAGradient) {
  const RolloutMaterial m = learned_materials()[GetParam()];
  RolloutScene scene = scene_of(m);
  scene.settings.steps = 5;
  scene.settings.every = 5;
  const LearnedNetworks both = leaves(m, torch::kFloat32);  // in a roll-out in float64
  loss_of(run(scene, m, both, m.parameters)).backward();
  EXPECT_EQ(both.stress.numbers.grad().scalar_type(), torch::kFloat32);
  LearnedNetworks one = to_networks(*m.law.weights, torch::kFloat32);
  one.stress.numbers.requires_grad_();
  loss_of(run(scene, m, one, m.parameters)).backward();
  EXPECT_FALSE(one.projection.numbers.grad().defined());
  EXPECT_TRUE(torch::equal(one.stress.numbers.grad(), both.stress.numbers.grad()));
  const LearnedNetworks none = to_networks(*m.law.weights, torch::kFloat64);
  EXPECT_FALSE(run(scene, m, none, m.parameters).requires_grad());
  // The same numbers by either way are the same roll-out.
  EXPECT_TRUE(torch::equal(run(scene, m, none, m.parameters), scene.run(m.law, m.parameters).x));
  const torch::NoGradGuard off;
  EXPECT_FALSE(run(scene, m, both, m.parameters).requires_grad());
}
INSTANTIATE_TEST_SUITE_P(, RolloutOfNetworks, ::testing::Range(0, 3),
                         [](const auto& info) { return learned_materials()[info.param].name; });

TEST(Rollout, UndefinedGradientsStayUndefinedAndConstantsNeedNoTape) {
  RolloutScene scene;
  const LawDescription law = sample_law(LawId::elastic);
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
  const RolloutScene good;
  const LawDescription law = sample_law(LawId::elastic);
  const auto message =
      [&](const std::function<void(RolloutScene&, RolloutBody&)>& spoil) -> std::string {
    RolloutScene s;
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
  EXPECT_EQ(message([](RolloutScene&, RolloutBody&) {}), "no error");
  EXPECT_EQ(message([](RolloutScene& s, RolloutBody&) { s.x = s.x.narrow(1, 0, 2); }),
            "rollout: x0: expected [any, 3] Double on cpu, found [125, 2] Double on cpu");
  EXPECT_THAT(message([](RolloutScene& s, RolloutBody&) { s.x = Tensor(); }),
              HasSubstr("x0: expected a Float"));
  EXPECT_THAT(message([&](RolloutScene& s, RolloutBody&) { s.v = single(s.v); }),
              HasSubstr("v0: expected [125, 3] Double on cpu, found [125, 3] Float"));
  EXPECT_THAT(message([&](RolloutScene& s, RolloutBody&) { s.C = s.C[0]; }),
              HasSubstr("C0: expected"));
  EXPECT_THAT(message([&](RolloutScene& s, RolloutBody&) { s.F = s.F[0]; }),
              HasSubstr("F0: expected"));
  EXPECT_THAT(message([&](RolloutScene& s, RolloutBody&) { s.mass = Tensor(); }),
              HasSubstr("mass: expected"));
  EXPECT_THAT(message([&](RolloutScene& s, RolloutBody&) { s.volume = single(s.volume); }),
              HasSubstr("volume: expected"));
  EXPECT_THAT(message([&](RolloutScene& s, RolloutBody&) { s.settings.every = 0; }),
              HasSubstr("every >= 1"));
  EXPECT_THAT(message([](RolloutScene&, RolloutBody& b) { b.parameters = torch::ones({3}); }),
              HasSubstr("parameters of body 0: expected [2] Float on cpu, found [3] Float"));
  const RolloutMaterial learned = learned_materials()[0];
  EXPECT_EQ(message([&](RolloutScene&, RolloutBody& b) {
              b.networks = to_networks(*learned.law.weights, torch::kFloat64);
              b.networks.stress.numbers = b.networks.stress.numbers.slice(0, 1);
            }),
            "rollout: body 0: networks.stress.numbers: expected [718] Double on cpu, found [717] "
            "Double on cpu");
  EXPECT_THAT(message([](RolloutScene&, RolloutBody& b) { b.end = 100; }),
              HasSubstr("bodies: expected the last one to end at particle 125, found 100"));
  EXPECT_THAT(message([](RolloutScene& s, RolloutBody&) { s.x = s.x + 0.4; }),
              HasSubstr("placed too close"));
}

}  // namespace
}  // namespace uniphy::ops
