#pragma once

#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "ops/base/torch.hpp"
#include "ops/learned/learned_law.hpp"
#include "tests/support/deformation_tensors.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::ops {

/// Pa, of the stress in a loss.
inline constexpr double kStressUnit = 1e4;

/// Form, activation, hidden layers.
using LearnedLawParameters = std::tuple<kernels::LawForm, kernels::Activation, int>;

class LearnedLawOp : public ::testing::TestWithParam<LearnedLawParameters> {
 protected:
  kernels::LawForm form() const { return std::get<0>(GetParam()); }
  LearnedNetworks networks(unsigned seed = 7) const {
    const auto [form, activation, hidden] = GetParam();
    return to_networks(testing::random_weights(form, 5, 20, hidden, activation, seed),
                       torch::kFloat64);
  }
  static torch::Tensor latent(torch::Dtype dtype = torch::kFloat64) {
    return torch::tensor({0.3, -0.2, 0.5, -0.7, 0.1}, torch::kFloat64).to(dtype);
  }
  static torch::Tensor rates(const torch::Tensor& F) {
    torch::manual_seed(17);
    return 8 * torch::randn_like(F);
  }
};

inline std::string learned_law_case(const ::testing::TestParamInfo<LearnedLawParameters>& info) {
  return std::string(kernels::form_name(std::get<0>(info.param))) + "_" +
         kernels::activation_name(std::get<1>(info.param)) + "_" +
         std::to_string(std::get<2>(info.param));
}

inline auto learned_law_cases() {
  using kernels::Activation;
  using kernels::LawForm;
  return ::testing::Values(LearnedLawParameters{LawForm::isotropic, Activation::gelu, 3},
                           LearnedLawParameters{LawForm::isotropic, Activation::silu, 2},
                           LearnedLawParameters{LawForm::isotropic, Activation::squareplus, 1},
                           LearnedLawParameters{LawForm::published, Activation::gelu, 2},
                           LearnedLawParameters{LawForm::published, Activation::silu, 0});
}

}  // namespace uniphy::ops
