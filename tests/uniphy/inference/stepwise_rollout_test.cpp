// Algorithm 2 line by line against the one op with its own adjoint.

#include "uniphy/inference/stepwise_rollout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/rollout_cases.hpp"
#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using testing::RolloutMaterial;
using testing::RolloutScene;
using torch::Tensor;

/// What a roll-out is differentiated by, and its frames.
struct Differentiated {
  std::vector<Tensor> leaves;
  std::vector<std::string> names;
  ops::RolloutFrames frames;

  Differentiated(const RolloutMaterial& m, bool stepwise) {
    RolloutScene scene = testing::scene_of(m);
    scene.settings.velocities = true;
    ops::RolloutBody body = scene.body(m.law, m.parameters.clone());
    if (m.law.id == kernels::LawId::learned) {
      body.networks = ops::to_networks(*m.law.weights, torch::kFloat64);
      leaves = {body.networks.projection.numbers, body.networks.stress.numbers};
      names = {"weights of the projection", "weights of the stress"};
    }
    leaves.insert(leaves.end(), {scene.x, scene.v, scene.C, scene.F, body.parameters});
    names.insert(names.end(), {"x", "v", "C", "F", "parameters"});
    if (scene.memory.defined()) {
      leaves.push_back(scene.memory);
      names.push_back("memory");
    }
    for (Tensor& leaf : leaves) leaf.requires_grad_();
    frames = (stepwise ? stepwise_rollout : ops::rollout)(scene.x, scene.v, scene.C, scene.F,
                                                          scene.mass, scene.volume, {body},
                                                          scene.settings, scene.memory);
  }
  std::vector<Tensor> gradients() const {
    return torch::autograd::grad({testing::loss_of(frames.x) + 0.01 * testing::loss_of(frames.v)},
                                 leaves);
  }
};

class StepwiseRollout : public ::testing::TestWithParam<int> {};

TEST_P(StepwiseRollout, AgreesWithTheFusedOneInValueAndGradient) {
  const RolloutMaterial material = testing::rollout_materials()[GetParam()];
  const Differentiated fused(material, false), stepwise(material, true);
  ASSERT_EQ(fused.frames.x.sizes(), stepwise.frames.x.sizes());
  EXPECT_LE((fused.frames.x - stepwise.frames.x).abs().max().item<double>(), 1e-12);
  EXPECT_LE((fused.frames.v - stepwise.frames.v).abs().max().item<double>(), 1e-10);
  const auto expected = fused.gradients(), found = stepwise.gradients();
  for (std::size_t i = 0; i < expected.size(); ++i) {
    // Each parameter of an analytic law by itself: their sizes differ by orders of magnitude.
    const bool apart = fused.names[i] == "parameters" && material.law.id != kernels::LawId::learned;
    const Tensor difference = found[i] - expected[i];
    if (apart) {
      EXPECT_GT(expected[i].abs().min().item<double>(), 0);
      EXPECT_LE((difference / expected[i]).abs().max().item<double>(), 1e-9) << "parameters";
    } else {
      EXPECT_GT(expected[i].norm().item<double>(), 0) << fused.names[i];
      EXPECT_LE((difference.norm() / expected[i].norm()).item<double>(), 1e-9) << fused.names[i];
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, StepwiseRollout, ::testing::Range(0, 14), [](const auto& info) {
  return testing::rollout_materials()[info.param].name;
});

TEST(StepwiseRolloutOfSeveral, BodiesEachFollowTheirLaw) {
  const auto materials = testing::rollout_materials();
  const RolloutMaterial &solid = materials[0], &sand = materials[7];
  ASSERT_TRUE(kernels::law_has_memory(sand.law.id));
  const RolloutScene scene = testing::scene_of(sand);
  const std::vector<ops::RolloutBody> bodies{{0, 50, solid.law, solid.parameters},
                                             {50, scene.x.size(0), sand.law, sand.parameters}};
  const auto x = [&](const auto& roll) {
    return roll(scene.x, scene.v, Tensor(), Tensor(), scene.mass, scene.volume, bodies,
                scene.settings, scene.memory)
        .x;
  };
  EXPECT_LE((x(stepwise_rollout) - x(ops::rollout)).abs().max().item<double>(), 1e-12);
}

TEST(StepwiseRolloutOfSeveral, AParticleThatLeavesTheGridIsNamedWithItsStep) {
  RolloutScene scene;
  scene.v = scene.v * 200;
  const auto material = testing::rollout_materials()[0];
  const std::string message = testing::error_of([&] {
    stepwise_rollout(scene.x, scene.v, Tensor(), Tensor(), scene.mass, scene.volume,
                     {scene.body(material.law, material.parameters)}, scene.settings);
  });
  EXPECT_THAT(message, ::testing::HasSubstr("rollout: step "));
  EXPECT_THAT(message, ::testing::HasSubstr("particle "));
}

}  // namespace
}  // namespace uniphy
