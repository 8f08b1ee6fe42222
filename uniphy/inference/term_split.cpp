#include "uniphy/inference/term_split.hpp"

#include <algorithm>
#include <cmath>

#include "ops/base/torch.hpp"

namespace uniphy {
namespace {

using torch::Tensor;

/// Of the coefficients, below which a law has no elastic shear to split.
constexpr double kNoShear = 1e-3;

double within(double x, double limit) { return std::clamp(x, -limit, limit); }

}  // namespace

std::vector<Tensor> split_terms(const AdaptedVariables& numbers, const Tensor& u) {
  if (numbers.form() != kernels::LawForm::isotropic) return {};
  const Tensor outputs = numbers.outputs(u);
  const auto place = [](kernels::StressOutput o) { return int(kernels::kCapOutputs) + int(o); };
  const auto at = [&](kernels::StressOutput o) { return outputs[place(o)].item<double>(); };
  const auto coefficient = [&](kernels::StressOutput o) {
    return std::sinh(within(at(o), kernels::kSinhLimit));
  };
  const auto exponent = [&](kernels::StressOutput o) {
    return within(at(o), kernels::kExponentLimit);
  };
  const double a1 = coefficient(kernels::kShear), a2 = coefficient(kernels::kSecondShear);
  const double a = a1 + a2;
  if (std::abs(a) < kNoShear) return {};
  const double n1 = exponent(kernels::kShearExponent), n2 = exponent(kernels::kSecondExponent);
  const double n = within((a1 * n1 + a2 * n2) / a, kernels::kExponentLimit);
  std::vector<Tensor> points;
  for (const double gap : {1.0, -1.0}) {
    Tensor point = u.detach().clone();
    const auto set = [&](kernels::StressOutput o, double value) {
      point[numbers.latent_size() + place(o)] += value - at(o);
    };
    set(kernels::kShear, std::asinh(2 * a));
    set(kernels::kSecondShear, std::asinh(-a));
    set(kernels::kShearExponent, n - gap);  // 2 a (n − gap) − a (n − 2 gap) = a n
    set(kernels::kSecondExponent, n - 2 * gap);
    points.push_back(point);
  }
  return points;
}

}  // namespace uniphy
