// The fused loss of the isotropic form against plain tensors and central differences.

#include "ops/loss/law_losses.hpp"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include "ops/base/torch.hpp"
#include "ops/reference/law_losses.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/law_loss_tensors.hpp"

namespace uniphy::ops {
namespace {

using testing::LawLossCase;
using torch::Tensor;

using Inputs = testing::LawLossInputs;

TEST(LawLosses, ValuesAndGradientsMatchPlainTensors) {
  for (const auto& [type, tolerance] :
       {std::pair{torch::kFloat64, 1e-11}, std::pair{torch::kFloat32, 2e-4}}) {
    for (const LawLossCase& c : testing::law_loss_cases()) {
      const Inputs in(c, type), wide(c, torch::kFloat64);
      const LawLosses got = in.errors();
      const std::vector<Tensor> g = in.gradients();
      const LawLosses want = wide.errors(&reference::law_losses);
      EXPECT_LE(testing::relative_difference(got.losses.to(torch::kFloat64), want.losses),
                tolerance);
      EXPECT_LE(testing::relative_difference(got.errors.to(torch::kFloat64), want.errors),
                tolerance);
      EXPECT_FALSE(got.errors.requires_grad());
      const std::vector<Tensor> expected = wide.gradients(&reference::law_losses);
      for (std::size_t k = 0; k < g.size(); ++k) {
        EXPECT_GT(expected[k].norm().item<double>(), 0) << k;
        EXPECT_LE(testing::relative_difference(g[k].to(torch::kFloat64), expected[k]), tolerance)
            << type << " input " << k << ", " << c.samples << " samples";
      }
    }
  }
}

TEST(LawLosses, GradientsAgreeWithCentralDifferences) {
  for (const LawLossCase& c : testing::law_loss_cases())
    for (const double error : testing::isotropic_gradient_errors(c)) EXPECT_LE(error, 1e-6);
}

TEST(LawLosses, AnswersAtRestMayBeTheAnswersThemselves) {
  const Inputs in(testing::law_loss_case(4, 37, false, false), torch::kFloat64);
  const auto loss = [&](decltype(&law_losses) losses) {
    const IsotropicAnswers answers{in.leaves[1], in.leaves[1], in.leaves[3], in.leaves[3]};
    return (in.seed * losses(in.batch, in.scales, in.leaves[0], answers, in.measure).losses).sum();
  };
  const std::vector<Tensor> of{in.leaves[1], in.leaves[3]};
  const auto got = torch::autograd::grad({loss(&law_losses)}, of);
  const auto want = torch::autograd::grad({loss(&reference::law_losses)}, of);
  for (std::size_t k = 0; k < of.size(); ++k)
    EXPECT_LE(testing::relative_difference(got[k], want[k]), 1e-11);
}

TEST(LawLosses, FeaturesMatchPlainTensors) {
  for (const LawLossCase& c : testing::law_loss_cases()) {
    const Inputs in(c, torch::kFloat64);
    const Tensor& z = in.leaves[0];
    const auto loss = [](const IsotropicFeatures& f) {
      return f.projection.sin().sum() + f.stress.sin().sum();
    };
    const IsotropicFeatures got = isotropic_features(in.batch, z);
    const IsotropicFeatures want = reference::isotropic_features(in.batch, z);
    EXPECT_LE(testing::relative_difference(got.projection, want.projection), 1e-13);
    EXPECT_LE(testing::relative_difference(got.stress, want.stress), 1e-13);
    const Tensor of_z = torch::autograd::grad({loss(got)}, {z})[0];
    EXPECT_GT(of_z.norm().item<double>(), 0);
    EXPECT_LE(testing::relative_difference(of_z, torch::autograd::grad({loss(want)}, {z})[0]),
              1e-11);
    const Tensor numerical = testing::numerical_gradient(
        [&](const Tensor& at) { return loss(isotropic_features(in.batch, at)).detach(); }, z, 1e-4);
    EXPECT_LE(testing::relative_difference(of_z, numerical), 1e-8);
    // One of the two alone.
    EXPECT_LE(testing::relative_difference(
                  torch::autograd::grad({isotropic_features(in.batch, z).stress.sum()}, {z})[0],
                  torch::autograd::grad({reference::isotropic_features(in.batch, z).stress.sum()},
                                        {z})[0]),
              1e-11);
  }
}

TEST(LawLosses, SameBitsOnOneThreadAndTwo) {
  const Inputs in(testing::law_loss_case(31, 37, true, true), torch::kFloat32);
  std::vector<std::vector<Tensor>> results;
  const int threads = at::get_num_threads();
  for (const int n : {1, 2}) {
    at::set_num_threads(n);
    results.push_back(in.gradients());
    const LawLosses e = in.errors();
    const IsotropicFeatures f = isotropic_features(in.batch, in.leaves[0]);
    for (const Tensor& t : {e.losses, e.errors, f.projection, f.stress})
      results.back().push_back(t.detach());
  }
  at::set_num_threads(threads);
  for (std::size_t k = 0; k < results[0].size(); ++k)
    EXPECT_TRUE(torch::equal(results[0][k], results[1][k])) << k;
}

TEST(LawLosses, UndefinedGradientsStayUndefined) {
  Inputs in(testing::law_loss_case(4, 7, true, false), torch::kFloat32);
  for (const std::size_t k : {0, 2, 4}) in.leaves[k] = in.leaves[k].detach();
  in.errors().losses.sum().backward();
  EXPECT_FALSE(in.leaves[0].grad().defined());
  EXPECT_TRUE(in.leaves[1].grad().defined());
}

TEST(LawLosses, RefusesWhatDoesNotFit) {
  const auto message = [](const auto& change) {
    Inputs in(testing::law_loss_case(4, 7, true, true), torch::kFloat32);
    change(in);
    return testing::error_of([&] { in.errors(); });
  };
  const auto expect = [&](const auto& change, const std::string& part) {
    EXPECT_NE(message(change).find(part), std::string::npos) << message(change);
  };
  expect(
      [](Inputs& in) {
        in.batch.columns = torch::zeros({50, 23});
      },
      "columns: expected [any, 24] Float on cpu, found [50, 23] Float");
  expect([](Inputs& in) { in.batch.rows = in.batch.rows + 100; },
         "rows: expected 0 ... 49, found 1");
  expect([](Inputs& in) { in.batch.rows = in.batch.rows.to(torch::kInt32); },
         "expected [any, any] Long");
  expect([](Inputs& in) { in.batch.rows = in.batch.rows.narrow(1, 0, 0); },
         "rows: expected one sample or more");
  expect([](Inputs& in) { in.scales = torch::zeros({4, 2}); }, "scales: expected [4, 4]");
  expect(
      [](Inputs& in) {
        in.leaves[0] = torch::zeros({4, 1});
      },
      "z: expected 2 numbers or more a trajectory, found 1");
  expect([](Inputs& in) { in.leaves[1] = torch::zeros({4, 6, 5}); }, "caps: expected [4, 7, 5]");
  expect(
      [](Inputs& in) {
        in.leaves[2] = torch::zeros({4, 7, 5});
      },
      "caps_rest: expected [4, 1, 5]");
  expect(
      [](Inputs& in) {
        in.leaves[3] = torch::zeros({4, 7, 14}, torch::kFloat64);
      },
      "moduli: expected [4, 7, 14] Float");
  expect(
      [](Inputs& in) {
        in.leaves[4] = torch::zeros({4, 1, 4});
      },
      "moduli_rest: expected [4, 1, 14]");
}

}  // namespace
}  // namespace uniphy::ops
