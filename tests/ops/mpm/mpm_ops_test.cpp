#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "ops/base/torch.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/mpm_op_cases.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::ops {
namespace {

using torch::Tensor;
using namespace testing;

TEST(MpmOps, ValuesAgreeWithTheReference) {
  for (const MpmOpCase& c : mpm_op_cases()) {
    for (const auto type : {torch::kFloat32, torch::kFloat64}) {
      const double tolerance = type == torch::kFloat64 ? 1e-13 : 8e-6;
      const TensorList inputs = c.inputs(type);
      const TensorList found = c.op(inputs), expected = c.reference(c.inputs(torch::kFloat64));
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
  for (const MpmOpCase& c : mpm_op_cases()) {
    const TensorList inputs = c.inputs(torch::kFloat64);
    const TensorList found = mpm_gradients(c.op, inputs),
                     expected = mpm_gradients(c.reference, inputs);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      EXPECT_GT(expected[i].norm().item<double>(), 0) << c.name << ", input " << i;
      EXPECT_LE(((found[i] - expected[i]).norm() / expected[i].norm()).item<double>(), 1e-14)
          << c.name << ", input " << i;
    }
  }
}

TEST(MpmOps, GradientsAgreeWithCentralDifferences) {
  for (const MpmOpCase& c : mpm_op_cases()) {
    for (std::size_t i = 0; i < c.names.size(); ++i) {
      EXPECT_LE(mpm_gradient_error(c, i), 3e-10) << c.name << ", " << c.names[i];
    }
  }
}

TEST(MpmOps, GradientsOfFloat32FollowThoseOfFloat64) {
  for (const MpmOpCase& c : mpm_op_cases()) {
    const TensorList found = mpm_gradients(c.op, c.inputs(torch::kFloat32));
    const TensorList expected = mpm_gradients(c.op, c.inputs(torch::kFloat64));
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_EQ(found[i].scalar_type(), torch::kFloat32);
      const Tensor error = (found[i].to(torch::kFloat64) - expected[i]).norm();
      EXPECT_LE((error / expected[i].norm()).item<double>(), 1e-5) << c.name << ", input " << i;
    }
  }
}

TEST(MpmOps, UndefinedGradientsStayUndefined) {
  const kernels::GridSettings s = small_grid();
  TensorList p = mpm_particles(torch::kFloat64);
  p[1].requires_grad_();
  const Tensor grid = p2g_of(p, s)[0];
  EXPECT_TRUE(grid.requires_grad());
  const auto answer = answer_of_backward(grid, {torch::ones_like(grid)});
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_EQ(answer[i].defined(), i == 1) << i;
  for (const Tensor& none : answer_of_backward(grid, {Tensor()})) EXPECT_FALSE(none.defined());
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
  const kernels::GridSettings s = small_grid();
  TensorList p = mpm_particles(torch::kFloat64);
  const Tensor expected = p2g_of(p, s)[0];
  for (Tensor& t : p) {
    if (t.dim() > 1) t = t.transpose(0, 1).contiguous().transpose(0, 1);
  }
  EXPECT_FALSE(p[0].is_contiguous());
  EXPECT_TRUE(torch::equal(p2g_of(p, s)[0], expected));
}

TEST(MpmOps, ErrorsNameTheArgument) {
  const kernels::GridSettings s = small_grid();
  const TensorList good = mpm_particles(torch::kFloat64);
  const char* names[] = {"x", "v", "C", "tau", "mass", "volume"};
  for (int i = 0; i < 6; ++i) {
    for (const Tensor& bad : {Tensor(), good[i].narrow(0, 0, 7).unsqueeze(0),
                              i == 0 ? good[0].to(torch::kInt64) : good[i].to(torch::kFloat32)}) {
      TensorList p = good;
      p[i] = bad;
      const std::string text = error_of([&] { p2g_of(p, s); });
      EXPECT_THAT(text, ::testing::HasSubstr(std::string("p2g: ") + names[i] + ": expected"));
      EXPECT_THAT(text, ::testing::HasSubstr("found"));
    }
  }
  EXPECT_EQ(error_of([&] {
              grid_update(torch::zeros({9, 9, 9, 3}, torch::kFloat64), s);
            }),
            "grid_update: grid: expected [9, 9, 9, 4] Double on cpu, found [9, 9, 9, 3] Double on "
            "cpu");
  EXPECT_EQ(error_of([&] {
              g2p(good[0], torch::zeros({9, 9, 9, 3}, torch::kFloat32), s);
            }),
            "g2p: velocity: expected [9, 9, 9, 3] Double on cpu, found [9, 9, 9, 3] Float on cpu");
  TensorList outside = good;
  outside[0] = good[0].clone();
  outside[0][3][1] = 0.99;
  EXPECT_THAT(error_of([&] { p2g_of(outside, s); }), ::testing::HasSubstr("particle 3 at"));
  TensorList weightless = good;
  weightless[4] = good[4].clone();
  weightless[4][2] = 0;
  EXPECT_THAT(error_of([&] { p2g_of(weightless, s); }),
              ::testing::HasSubstr("p2g: expected a positive mass of particle 2, found 0.000000"));
  kernels::GridSettings impossible = s;
  impossible.n = -1;
  EXPECT_THAT(error_of([&] { p2g_of(good, impossible); }), ::testing::HasSubstr("found -1"));
}

}  // namespace
}  // namespace uniphy::ops
