// The judge of gradients is itself judged: a right one holds, every kind of wrong one is seen.

#include "uniphy/stability/gradient_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ops/base/torch.hpp"

namespace uniphy::stability {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;

const std::vector<double> kStates{1.2, 0.1, 0,    0.2, 0.9, 0.1,  0,   -0.1, 1.1,
                                  0.8, 0,   -0.2, 0.1, 1.3, 0.05, 0.1, 0,    0.9};

Cell judge(GradientCheck check, std::vector<double> F = kStates) {
  if (!check.reference) check.reference = check.function;
  Cell cell;
  check_gradients(F, check, cell);
  return cell;
}

Tensor smooth(const Tensor& F) { return torch::matmul(F, F.mT()).flatten(1).sin(); }

TEST(GradientCheck, ARightGradientHolds) {
  const Cell cell = judge({smooth, {}, {}, false, 1});
  EXPECT_EQ(cell.verdict, Verdict::holds);
  EXPECT_LT(*cell.find("gradient_error"), 1e-10);
  EXPECT_EQ(cell.find("finite_share"), 1);
  EXPECT_EQ(cell.find("derivative_share"), 1);
  EXPECT_EQ(cell.find("states"), 2);
}

TEST(GradientCheck, AWrongGradientFailsByItsError) {
  // Half of the value carries no gradient.
  const auto half = [](const Tensor& F) { return 0.5 * smooth(F) + 0.5 * smooth(F.detach()); };
  const Cell cell = judge({half, smooth, {}, false, 1});
  EXPECT_EQ(cell.verdict, Verdict::fails);
  EXPECT_NEAR(*cell.find("gradient_error"), 0.5, 1e-9);
  EXPECT_NEAR(*cell.find("gradient_error_together"), 0.5, 1e-9);
  EXPECT_EQ(cell.failure.particle, 0);
  EXPECT_THAT(cell.failure.cause, HasSubstr("wrong by 0.5"));
}

TEST(GradientCheck, AGradientThatIsNotFiniteFailsAndSettingItToZeroIsCounted) {
  // √(x²) has no derivative at 0, an entry of the second state; differences find 0 for it.
  const auto entry = [](const Tensor& F) { return F.select(1, 2).select(1, 1).unsqueeze(1); };
  const auto root = [entry](const Tensor& F) {
    return smooth(F) + 1e-3 * entry(F).square().sqrt();
  };
  const auto same = [entry](const Tensor& F) { return smooth(F) + 1e-3 * entry(F).abs(); };
  const Cell raw = judge({root, same, {}, false, 1});
  EXPECT_EQ(raw.verdict, Verdict::fails);
  EXPECT_EQ(raw.find("finite_share"), 0.5);
  EXPECT_EQ(raw.failure.particle, 1);
  EXPECT_THAT(raw.failure.cause, HasSubstr("not finite"));

  const Cell zeroed = judge({root, same, {}, true, 1});
  EXPECT_EQ(zeroed.find("finite_share"), 1);
  EXPECT_EQ(zeroed.find("zeroed"), 1);
  EXPECT_EQ(zeroed.verdict, Verdict::fails);
}

TEST(GradientCheck, AValueThatJumpsHasNoDerivative) {
  const auto jump = [](const Tensor& F) {
    return smooth(F) + (F.flatten(1).select(1, 1) > torch::tensor({0.1, 0.0}, torch::kFloat64))
                           .to(torch::kFloat64)
                           .unsqueeze(1);
  };
  const Cell cell = judge({jump, {}, {}, false, 1});
  EXPECT_EQ(cell.verdict, Verdict::fails);
  EXPECT_EQ(cell.find("derivative_share"), 0);
  EXPECT_THAT(cell.failure.cause, HasSubstr("no derivative"));
}

TEST(GradientCheck, WhereTheRotationJumpsFinitenessAloneCounts) {
  const std::vector<double> rank_one{1, 0, 0, 0, 0, 0, 0, 0, 0};
  const Cell cell = judge({smooth, {}, {}, false, 1}, rank_one);
  EXPECT_EQ(cell.find("left_out_share"), 1);
  EXPECT_EQ(cell.verdict, Verdict::holds);
}

}  // namespace
}  // namespace uniphy::stability
