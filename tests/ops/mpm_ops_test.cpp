#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/torch.h>

#include <functional>
#include <vector>

#include "ops/g2p.hpp"
#include "ops/grid_update.hpp"
#include "ops/kernels/error.hpp"
#include "ops/p2g.hpp"
#include "ops/reference/g2p.hpp"
#include "ops/reference/grid_update.hpp"
#include "ops/reference/p2g.hpp"
#include "tests/support/finite_differences.hpp"

namespace uniphy::ops {
namespace {

using kernels::GridSettings;
using kernels::Wall;
using testing::central_differences;
using testing::relative_error;
using torch::Tensor;
using Tensors = std::vector<Tensor>;
using Op = std::function<Tensors(const Tensors&)>;

constexpr std::int64_t kParticles = 40;

GridSettings small_grid(Wall wall = Wall::freeslip) {
  GridSettings s;
  s.n = 9;  // walls and free nodes both within reach
  s.wall = wall;
  s.gravity[0] = 3;
  return s;
}

Tensor uniform(at::IntArrayRef sizes, double low, double high, torch::ScalarType type) {
  return (torch::rand(sizes, torch::kFloat64) * (high - low) + low).to(type);
}

/// x, v, C, tau, mass, volume; stresses so large that all terms of the momentum are of one size.
Tensors particles(torch::ScalarType type) {
  torch::manual_seed(1);
  return {
      uniform({kParticles, 3}, 0.2, 0.75, type),    uniform({kParticles, 3}, -2, 2, type),
      uniform({kParticles, 3, 3}, -20, 20, type),   uniform({kParticles, 3, 3}, -9e3, 9e3, type),
      uniform({kParticles}, 0.5, 1.5, type) * 1e-2, uniform({kParticles}, 0.5, 1.5, type) * 1e-5};
}

Tensors p2g_of(const Tensors& p, const GridSettings& s) {
  return {p2g(p[0], p[1], p[2], p[3], p[4], p[5], s)};
}
Tensors p2g_reference(const Tensors& p, const GridSettings& s) {
  return {reference::p2g(p[0], p[1], p[2], p[3], p[4], p[5], s)};
}
Tensors g2p_of(const Tensors& p, const GridSettings& s) {
  const G2p r = g2p(p[0], p[1], s);
  return {r.x, r.v, r.C};
}
Tensors g2p_reference(const Tensors& p, const GridSettings& s) {
  const G2p r = reference::g2p(p[0], p[1], s);
  return {r.x, r.v, r.C};
}

struct Case {
  const char* name;
  Op op, reference;
  std::function<Tensors(torch::ScalarType)> inputs;
  std::vector<double> step;  ///< of central differences, for each input
};

std::vector<Case> cases() {
  std::vector<Case> all;
  const GridSettings s = small_grid();
  all.push_back({"p2g",
                 [s](const Tensors& p) { return p2g_of(p, s); },
                 [s](const Tensors& p) { return p2g_reference(p, s); },
                 [](torch::ScalarType type) { return particles(type); },
                 {1e-5, 1e-2, 1e-1, 10, 1e-5, 1e-8}});
  for (const Wall wall : {Wall::freeslip, Wall::noslip}) {
    const GridSettings w = small_grid(wall);
    all.push_back({wall == Wall::freeslip ? "grid_update freeslip" : "grid_update noslip",
                   [w](const Tensors& p) { return Tensors{grid_update(p[0], w)}; },
                   [w](const Tensors& p) { return Tensors{reference::grid_update(p[0], w)}; },
                   [](torch::ScalarType type) {  // a third of the nodes is empty
                     torch::manual_seed(2);
                     const Tensor momentum = uniform({9, 9, 9, 3}, -2e-2, 2e-2, torch::kFloat64);
                     const Tensor mass = uniform({9, 9, 9, 1}, 0.5e-2, 1.5e-2, torch::kFloat64) *
                                         (torch::rand({9, 9, 9, 1}) > 0.3).to(torch::kFloat64);
                     return Tensors{torch::cat({momentum * (mass > 0), mass}, 3).to(type)};
                   },
                   {1e-6}});
  }
  all.push_back({"g2p",
                 [s](const Tensors& p) { return g2p_of(p, s); },
                 [s](const Tensors& p) { return g2p_reference(p, s); },
                 [](torch::ScalarType type) {
                   return Tensors{particles(type)[0], uniform({9, 9, 9, 3}, -2, 2, type)};
                 },
                 {1e-5, 1e-2}});
  return all;
}

/// A fixed random linear functional of all results, each weighted by the size that it has in
/// `like`.
Tensor loss(const Tensors& results, const Tensors& like) {
  torch::manual_seed(7);
  Tensor sum = torch::zeros({}, torch::kFloat64);
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Tensor weight = torch::randn(results[i].sizes(), torch::kFloat64);
    sum = sum + (weight.to(results[i].scalar_type()) * results[i]).sum() /
                    like[i].abs().max().item<double>();
  }
  return sum;
}

Tensors gradients(const Op& op, const Tensors& inputs) {
  Tensors leaves;
  for (const Tensor& t : inputs) leaves.push_back(t.detach().clone().requires_grad_());
  const Tensors results = op(leaves);
  return torch::autograd::grad({loss(results, results)}, leaves);
}

TEST(MpmOps, ValuesAgreeWithTheReference) {
  for (const Case& c : cases()) {
    for (const auto type : {torch::kFloat32, torch::kFloat64}) {
      const double tolerance = type == torch::kFloat64 ? 1e-13 : 2e-5;
      const Tensors inputs = c.inputs(type);
      const Tensors found = c.op(inputs), expected = c.reference(c.inputs(torch::kFloat64));
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].scalar_type(), type);
        EXPECT_EQ(found[i].sizes(), expected[i].sizes());
        const Tensor error = (found[i].to(torch::kFloat64) - expected[i]).abs().max();
        EXPECT_LE((error / expected[i].abs().max()).item<double>(), tolerance)
            << c.name << ", result " << i << ", " << type;
      }
    }
  }
}

TEST(MpmOps, GradientsAgreeWithTheReference) {
  for (const Case& c : cases()) {
    const Tensors inputs = c.inputs(torch::kFloat64);
    const Tensors found = gradients(c.op, inputs), expected = gradients(c.reference, inputs);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      EXPECT_GT(expected[i].norm().item<double>(), 0) << c.name << ", input " << i;
      EXPECT_LE(((found[i] - expected[i]).norm() / expected[i].norm()).item<double>(), 1e-12)
          << c.name << ", input " << i;
    }
  }
}

TEST(MpmOps, GradientsAgreeWithCentralDifferences) {
  for (const Case& c : cases()) {
    const Tensors inputs = c.inputs(torch::kFloat64);
    const Tensors gradient = gradients(c.op, inputs), like = c.op(inputs);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      // Twenty coordinates of each input, the largest gradients among them.
      const Tensor flat = gradient[i].flatten();
      const Tensor picked = std::get<1>(flat.abs().topk(20));
      std::vector<double> found, expected;
      for (int q = 0; q < 20; ++q) {
        const std::int64_t k = picked[q].item<std::int64_t>();
        const auto value = [&](const std::vector<double>& t) {
          Tensors moved = inputs;
          moved[i] = inputs[i].clone();
          moved[i].view({-1})[k] += t[0];
          return loss(c.op(moved), like).item<double>();
        };
        found.push_back(flat[k].item<double>());
        expected.push_back(central_differences(value, {0}, {c.step[i]})[0]);
      }
      EXPECT_LE(relative_error(found, expected), 1e-6) << c.name << ", input " << i;
    }
  }
}

TEST(MpmOps, GradientsOfFloat32FollowThoseOfFloat64) {
  for (const Case& c : cases()) {
    const Tensors found = gradients(c.op, c.inputs(torch::kFloat32));
    const Tensors expected = gradients(c.op, c.inputs(torch::kFloat64));
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_EQ(found[i].scalar_type(), torch::kFloat32);
      const Tensor error = (found[i].to(torch::kFloat64) - expected[i]).norm();
      EXPECT_LE((error / expected[i].norm()).item<double>(), 1e-4) << c.name << ", input " << i;
    }
  }
}

TEST(MpmOps, UndefinedGradientsStayUndefined) {
  const GridSettings s = small_grid();
  Tensors p = particles(torch::kFloat64);
  p[1].requires_grad_();
  const Tensor grid = p2g_of(p, s)[0];
  EXPECT_TRUE(grid.requires_grad());
  grid.sum().backward();
  EXPECT_TRUE(p[1].grad().defined());
  for (const int i : {0, 2, 3, 4, 5}) EXPECT_FALSE(p[i].grad().defined());
  // Only one of three results is used: the others bring no gradient, and no zeros either.
  p[0].requires_grad_();
  const Tensor velocity = uniform({9, 9, 9, 3}, -1, 1, torch::kFloat64);
  const G2p all = g2p(p[0], velocity, s), one = g2p(p[0], velocity, s);
  const Tensor weight = torch::randn({kParticles, 3, 3}, torch::kFloat64);
  const Tensor a = torch::autograd::grad({(all.C * weight).sum() + 0 * all.x.sum()}, {p[0]})[0];
  const Tensor b = torch::autograd::grad({(one.C * weight).sum()}, {p[0]})[0];
  EXPECT_TRUE(torch::equal(a, b));
  EXPECT_GT(b.norm().item<double>(), 0);
}

TEST(MpmOps, AcceptWhatIsNotContiguous) {
  const GridSettings s = small_grid();
  Tensors p = particles(torch::kFloat64);
  const Tensor expected = p2g_of(p, s)[0];
  for (Tensor& t : p) {
    if (t.dim() > 1) t = t.transpose(0, 1).contiguous().transpose(0, 1);
  }
  EXPECT_FALSE(p[0].is_contiguous());
  EXPECT_TRUE(torch::equal(p2g_of(p, s)[0], expected));
}

TEST(MpmOps, ErrorsNameTheArgument) {
  const GridSettings s = small_grid();
  const auto message = [](const std::function<void()>& f) -> std::string {
    try {
      f();
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  const Tensors good = particles(torch::kFloat64);
  const char* names[] = {"x", "v", "C", "tau", "mass", "volume"};
  for (int i = 0; i < 6; ++i) {
    for (const Tensor& bad : {Tensor(), good[i].narrow(0, 0, 7).unsqueeze(0),
                              i == 0 ? good[0].to(torch::kInt64) : good[i].to(torch::kFloat32)}) {
      Tensors p = good;
      p[i] = bad;
      const std::string text = message([&] { p2g_of(p, s); });
      EXPECT_THAT(text, ::testing::HasSubstr(std::string("p2g: ") + names[i] + ": expected"));
      EXPECT_THAT(text, ::testing::HasSubstr("found"));
    }
  }
  EXPECT_EQ(message([&] {
              grid_update(torch::zeros({9, 9, 9, 3}, torch::kFloat64), s);
            }),
            "grid_update: grid: expected [9, 9, 9, 4] Double on cpu, found [9, 9, 9, 3] Double on "
            "cpu");
  EXPECT_EQ(message([&] {
              g2p(good[0], torch::zeros({9, 9, 9, 3}, torch::kFloat32), s);
            }),
            "g2p: velocity: expected [9, 9, 9, 3] Double on cpu, found [9, 9, 9, 3] Float on cpu");
  Tensors outside = good;
  outside[0] = good[0].clone();
  outside[0][3][1] = 0.99;
  EXPECT_THAT(message([&] { p2g_of(outside, s); }), ::testing::HasSubstr("particle 3 at"));
}

}  // namespace
}  // namespace uniphy::ops
