// The fused network op against plain tensors and central differences.

#include "ops/mlp/mlp.hpp"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/reference/mlp.hpp"
#include "tests/support/network_cases.hpp"

namespace uniphy::ops {
namespace {

using testing::network_layers;
using testing::network_leaves;
using torch::Tensor;

class MlpTest : public ::testing::TestWithParam<kernels::Activation> {};

TEST_P(MlpTest, ValueAndGradientsMatchPlainTensors) {
  for (const auto& widths : {std::vector<std::int64_t>{11, 20, 33, 5}, {7, 2}, {3, 128, 1}}) {
    for (const std::int64_t samples : {1, 64, 700}) {
      const auto l = network_layers(widths, torch::kFloat64);
      const Tensor x = torch::randn({samples, widths.front()}, torch::kFloat64).requires_grad_();
      const Tensor seed = torch::randn({samples, widths.back()}, torch::kFloat64);
      const Tensor y = mlp(x, l, GetParam()), expected = reference::mlp(x, l, GetParam());
      EXPECT_LE((y - expected).abs().max().item<double>(), 1e-12);
      const auto got = torch::autograd::grad({y}, network_leaves(x, l), {seed});
      const auto want = torch::autograd::grad({expected}, network_leaves(x, l), {seed});
      for (std::size_t k = 0; k < got.size(); ++k) {
        EXPECT_GT(want[k].norm().item<double>(), 0);
        EXPECT_LE(((got[k] - want[k]).norm() / want[k].norm()).item<double>(), 1e-12) << k;
      }
    }
  }
}

TEST_P(MlpTest, CodesOfManySamplesAreCodesBesideEverySample) {
  for (const std::int64_t samples : {1, 33, 64, 150}) {
    const auto l = network_layers({3 + 8, 20, 33, 5}, torch::kFloat64);
    const Tensor features = torch::randn({7, samples, 3}, torch::kFloat64).requires_grad_();
    const Tensor z = torch::randn({7, 8}, torch::kFloat64).requires_grad_();
    const Tensor seed = torch::randn({7, samples, 5}, torch::kFloat64);
    std::vector<Tensor> leaves = network_leaves(features, l);
    leaves.push_back(z);
    const Tensor y = mlp(features, z, l, GetParam());
    const auto got = torch::autograd::grad({y}, leaves, {seed});
    const Tensor expected = reference::mlp(features, z, flatten(l), GetParam());
    EXPECT_LE((y - expected).abs().max().item<double>(), 1e-12);
    const auto want = torch::autograd::grad({expected}, leaves, {seed});
    for (std::size_t k = 0; k < got.size(); ++k)
      EXPECT_LE(((got[k] - want[k]).norm() / want[k].norm()).item<double>(), 1e-12) << k;
  }
}

TEST_P(MlpTest, GradientsAgreeWithCentralDifferences) {
  const testing::NetworkErrors errors = testing::network_errors(GetParam());
  EXPECT_LE(errors.x, 1e-8);
  EXPECT_LE(errors.weights, 1e-8);
  EXPECT_LE(errors.biases, 1e-8);
}

/// Lanes of floats have polynomials of their own for the activations.
TEST_P(MlpTest, FloatsAreDoublesToRounding) {
  const auto identity = [](torch::Dtype type) {
    const LinearLayer layer{torch::ones({1, 1}, type), torch::zeros({1}, type)};
    return std::vector<LinearLayer>{layer, layer};
  };
  const Tensor x = torch::cat({torch::linspace(-40, 40, 20001, torch::kFloat32),
                               torch::logspace(-8, 4, 500, 10.0, torch::kFloat32),
                               -torch::logspace(-8, 4, 500, 10.0, torch::kFloat32)})
                       .unsqueeze(1)
                       .requires_grad_();
  const Tensor exact_x = x.detach().to(torch::kFloat64).requires_grad_();
  const Tensor y = mlp(x, identity(torch::kFloat32), GetParam());
  const Tensor exact = reference::mlp(exact_x, identity(torch::kFloat64), GetParam());
  EXPECT_LE(((y - exact) / exact_x.abs().clamp_min(1)).abs().max().item<double>(), 3e-7);
  const Tensor slope = torch::autograd::grad({y.sum()}, {x})[0];
  const Tensor exact_slope = torch::autograd::grad({exact.sum()}, {exact_x})[0];
  EXPECT_LE((slope - exact_slope).abs().max().item<double>(), 1.5e-6);
}

TEST_P(MlpTest, FlatLayersAreTheLayers) {
  const auto l = network_layers({3 + 8, 20, 33, 5}, torch::kFloat64);
  FlatLayers flat = flatten(l);
  flat.numbers = flat.numbers.detach().requires_grad_();
  const auto views = layers_of(flat);
  ASSERT_EQ(views.size(), l.size());
  const Tensor features = torch::randn({7, 64, 3}, torch::kFloat64).requires_grad_();
  const Tensor z = torch::randn({7, 8}, torch::kFloat64).requires_grad_();
  const Tensor seed = torch::randn({7, 64, 5}, torch::kFloat64);
  const Tensor y = mlp(features, z, flat, GetParam());
  EXPECT_TRUE(torch::equal(y, mlp(features, z, l, GetParam())));
  const auto got = torch::autograd::grad({y}, {flat.numbers, features, z}, {seed});
  const auto want = torch::autograd::grad({mlp(features, z, views, GetParam())},
                                          {flat.numbers, features, z}, {seed});
  for (std::size_t k = 0; k < got.size(); ++k) EXPECT_TRUE(torch::equal(got[k], want[k])) << k;
  EXPECT_LE((reference::mlp(features, z, flat, GetParam()) - y).abs().max().item<double>(), 1e-12);
}

/// Whatever the order of memory, the same bits; what comes out has the order of what goes in.
TEST_P(MlpTest, TakesSamplesInPlanes) {
  const FlatLayers flat = flatten(network_layers({3 + 8, 20, 5}, torch::kFloat32));
  const Tensor rows = torch::randn({7, 90, 3}), z = torch::randn({7, 8});
  const Tensor planes = rows.transpose(1, 2).contiguous().transpose(1, 2);
  const Tensor seed = torch::randn({7, 90, 5});
  std::vector<Tensor> values, gradients;
  for (const Tensor& features : {rows, planes}) {
    const Tensor x = features.detach().requires_grad_();
    values.push_back(mlp(x, z, flat, GetParam()));
    EXPECT_EQ(values.back().stride(1) == 1, x.stride(1) == 1);
    gradients.push_back(torch::autograd::grad({values.back()}, {x}, {seed})[0]);
  }
  EXPECT_TRUE(torch::equal(values[0], values[1]));
  EXPECT_TRUE(torch::equal(gradients[0], gradients[1]));
}

TEST_P(MlpTest, SameBitsOnOneThreadAndTwo) {
  const auto l = network_layers({11, 32, 32, 5}, torch::kFloat32);
  const Tensor x = torch::randn({3001, 11}).requires_grad_();
  const Tensor features = torch::randn({31, 70, 3}), z = torch::randn({31, 8}).requires_grad_();
  std::vector<std::vector<Tensor>> results;
  const int threads = at::get_num_threads();
  for (const int n : {1, 2}) {
    at::set_num_threads(n);
    const Tensor y = mlp(x, l, GetParam());
    results.push_back(torch::autograd::grad({y}, network_leaves(x, l), {torch::ones_like(y)}));
    results.back().push_back(y.detach());
    const Tensor of_codes = mlp(features, z, l, GetParam());
    for (const Tensor& g : torch::autograd::grad({of_codes.sum()}, {z, l[0].weight, l[1].bias}))
      results.back().push_back(g);
    results.back().push_back(of_codes.detach());
  }
  at::set_num_threads(threads);
  for (std::size_t k = 0; k < results[0].size(); ++k)
    EXPECT_TRUE(torch::equal(results[0][k], results[1][k])) << k;
}

INSTANTIATE_TEST_SUITE_P(Activations, MlpTest,
                         ::testing::Values(kernels::Activation::gelu, kernels::Activation::silu,
                                           kernels::Activation::squareplus),
                         [](const auto& info) { return kernels::activation_name(info.param); });

TEST(Mlp, RefusesWhatDoesNotFit) {
  const auto l = network_layers({4, 8, 2}, torch::kFloat32);
  try {
    mlp(torch::zeros({3, 5}), l, kernels::Activation::silu);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("expected a weight [out, 5]"), std::string::npos)
        << e.what();
  }
  EXPECT_THROW(mlp(torch::zeros({3, 40, 2}), torch::zeros({2, 2}), l, kernels::Activation::silu),
               Error);
  EXPECT_THROW(mlp(torch::zeros({3, 40, 2}), torch::zeros({3, 3}), l, kernels::Activation::silu),
               Error);
  EXPECT_THROW(mlp(torch::zeros({4}), l, kernels::Activation::silu), Error);
  EXPECT_THROW(mlp(torch::zeros({3, 4}, torch::kFloat64), l, kernels::Activation::silu), Error);
  EXPECT_THROW(mlp(torch::zeros({3, 4}), {}, kernels::Activation::silu), Error);
  EXPECT_THROW(flatten({}), Error);
  const FlatLayers flat = flatten(l);
  const auto refused = [](const Tensor& features, const Tensor& z, const FlatLayers& layers) {
    try {
      mlp(features, z, layers, kernels::Activation::silu);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("nothing was refused");
  };
  const Tensor features = torch::zeros({3, 40, 2}), z = torch::zeros({3, 2});
  EXPECT_NE(refused(features, torch::zeros({3, 3}), flat)
                .find("the first of which takes 5 numbers, found 4"),
            std::string::npos);
  EXPECT_NE(refused(features, z, {flat.numbers.narrow(0, 1, 57), flat.widths})
                .find("expected [58] numbers of type Float, found Float [57]"),
            std::string::npos);
  EXPECT_NE(refused(features, z, {flat.numbers.to(torch::kFloat64), flat.widths})
                .find("expected [58] numbers of type Float, found Double [58]"),
            std::string::npos);
  EXPECT_NE(refused(features, z, {flat.numbers, {}}).find("found none"), std::string::npos);
}

TEST(Mlp, UndefinedGradientsStayUndefined) {
  const auto l = network_layers({4, 8, 2}, torch::kFloat32);
  const Tensor x = torch::randn({3, 4});  // no gradient asked for
  mlp(x, l, kernels::Activation::silu).sum().backward();
  EXPECT_FALSE(x.grad().defined());
  EXPECT_TRUE(l[0].weight.grad().defined());
}

TEST(Mlp, FrozenWeightsLeaveTheGradientOfTheInputAsItIs) {
  auto l = network_layers({11, 32, 5}, torch::kFloat32);
  const Tensor x = torch::randn({300, 11}).requires_grad_();
  const auto gradient = [&] {
    const Tensor y = mlp(x, l, kernels::Activation::silu);
    return torch::autograd::grad({y.pow(2).sum()}, {x})[0];
  };
  const Tensor with_weights = gradient();
  for (LinearLayer& layer : l) layer = {layer.weight.detach(), layer.bias.detach()};
  EXPECT_TRUE(torch::equal(gradient(), with_weights));
}

}  // namespace
}  // namespace uniphy::ops
