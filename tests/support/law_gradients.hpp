#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "ops/kernels/laws/law_parameters.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/law_cases.hpp"

namespace uniphy::testing {

/// Which entry of the table is differentiated.
enum class Stage { project, stress, fused };

inline const char* stage_name(Stage stage) {
  return stage == Stage::project ? "project" : stage == Stage::stress ? "stress" : "fused";
}

using ParameterArray = std::vector<double>;  ///< in the order of kLawParameterTable

inline ParameterArray parameter_array(const kernels::LawDescription& d) {
  ParameterArray values;
  for (const kernels::LawParameter& p : kernels::kLawParameterTable) values.push_back(d.*p.member);
  return values;
}
inline kernels::LawParameters<double> to_parameters(const ParameterArray& p) {
  kernels::LawParameters<double> parameters;
  for (int i = 0; i < kernels::kLawParameters; ++i)
    parameters.*kernels::kLawParameterMembers<double>[i] = p[i];
  return parameters;
}

/// The scalar L = W₁ : F_proj + W₂ : τ/s + W₃ · memory after of one particle, its gradient by the
/// adjoint kernels and by central differences.
struct LawGradientCheck {
  kernels::LawTable<double>::Law law;
  std::vector<int> places;  ///< the parameters that the law has
  Stage stage = Stage::fused;
  double dt = 1e-4;
  Matrix W1, W2;  ///< W2 already divided by the stress scale
  double W3 = 0;
  double memory = 0;  ///< before the step
  bool linear_in_C = true;

  static kernels::View<const double> view(const double* data) { return {data, 9, 1}; }
  static kernels::View<double> view(double* data) { return {data, 9, 1}; }

  double loss(const Matrix& F, const Matrix& C, const ParameterArray& p) const {
    return loss(F, C, p, memory);
  }
  double loss(const Matrix& F, const Matrix& C, const ParameterArray& p, double before) const {
    Matrix projected{}, tau{};
    double after = 0;
    const kernels::LawMemory<double> of_law{{&before, 1, 1}, {&after, 1, 1}};
    const auto parameters = to_parameters(p);
    if (stage == Stage::project) {
      law.project(1, parameters, dt, view(F.data()), view(projected.data()), of_law);
      return inner(W1, projected) + W3 * after;
    }
    if (stage == Stage::stress) {
      law.stress(1, parameters, view(F.data()), view(C.data()), view(tau.data()));
      return inner(W2, tau);
    }
    law.evaluate(1, parameters, dt, view(F.data()), view(C.data()), view(projected.data()),
                 view(tau.data()), of_law);
    return inner(W1, projected) + inner(W2, tau) + W3 * after;
  }

  void adjoint(const Matrix& F, const Matrix& C, const ParameterArray& p, Matrix& grad_F,
               Matrix& grad_C, ParameterArray& grad_p, double* grad_memory = nullptr) const {
    kernels::LawParameters<double> sum;
    double none = 0;
    const kernels::LawMemoryAdjoint<double> of_law{
        {&memory, 1, 1}, {&W3, 1, 1}, {grad_memory ? grad_memory : &none, 1, 1}};
    const auto parameters = to_parameters(p);
    grad_F = {};
    grad_C = {};
    grad_p.clear();
    if (stage == Stage::project) {
      law.project_adjoint(1, parameters, dt, view(F.data()), view(W1.data()), view(grad_F.data()),
                          &sum, of_law);
    } else if (stage == Stage::stress) {
      law.stress_adjoint(1, parameters, view(F.data()), view(C.data()), view(W2.data()),
                         view(grad_F.data()), view(grad_C.data()), &sum);
    } else {
      law.adjoint(1, parameters, dt, view(F.data()), view(C.data()), view(W1.data()),
                  view(W2.data()), view(grad_F.data()), view(grad_C.data()), &sum, of_law);
    }
    for (int i = 0; i < kernels::kLawParameters; ++i)
      grad_p.push_back(sum.*kernels::kLawParameterMembers<double>[i]);
  }

  struct Errors {
    double F = 0, C = 0, parameters = 0, memory = 0;
    double size_F = 0, size_C = 0, size_parameters = 0;  ///< norms of the differences' gradients
    double worst() const { return std::max({F, C, parameters, memory}); }
  };

  Errors errors(const Matrix& F, const Matrix& C, const ParameterArray& p, double step) const {
    Matrix grad_F, grad_C;
    ParameterArray grad_p;
    double grad_memory = 0;
    adjoint(F, C, p, grad_F, grad_C, grad_p, &grad_memory);
    const double of_memory = central_differences(
        [&](const std::vector<double>& x) { return loss(F, C, p, x[0]); }, {memory}, {3e-6})[0];
    const auto vector = [](const Matrix& m) { return std::vector<double>(m.begin(), m.end()); };
    const auto matrix = [](const std::vector<double>& v) {
      Matrix m;
      std::copy(v.begin(), v.end(), m.begin());
      return m;
    };
    const std::vector<double> of_F =
        central_differences([&](const std::vector<double>& x) { return loss(matrix(x), C, p); },
                            vector(F), std::vector<double>(9, step));
    // Most laws are linear in C, so that a large step costs nothing.
    const std::vector<double> of_C =
        central_differences([&](const std::vector<double>& x) { return loss(F, matrix(x), p); },
                            vector(C), std::vector<double>(9, linear_in_C ? 10.0 : 1e-2));
    std::vector<double> steps(p.size());
    for (std::size_t i = 0; i < p.size(); ++i) steps[i] = 2e-4 * p[i];
    std::vector<double> of_p =
        central_differences([&](const std::vector<double>& x) { return loss(F, C, x); }, p, steps);
    // Parameters differ by orders of magnitude: compare the derivatives by their logarithms.
    for (std::size_t i = 0; i < p.size(); ++i) {
      of_p[i] *= p[i];
      grad_p[i] *= p[i];
    }
    Errors e;
    const auto size = [](const std::vector<double>& v) {
      return relative_error(std::vector<double>(v.size(), 0.0), v) > 0
                 ? std::sqrt(std::inner_product(v.begin(), v.end(), v.begin(), 0.0))
                 : 0.0;
    };
    e.size_F = size(of_F);
    e.size_C = size(of_C);
    e.size_parameters = size(of_p);
    e.F = relative_error(vector(grad_F), of_F);
    // One number, which may cancel to next to nothing.
    e.memory = std::abs(grad_memory - of_memory) / std::max(std::abs(of_memory), 1e-2);
    // Near det F = 0 the pressure of a fluid, J⁻⁶, drowns differences with respect to C.
    if (det(F) > 0.1) e.C = relative_error(vector(grad_C), of_C);
    e.parameters = relative_error(grad_p, of_p);
    return e;
  }
};

/// A check of one law at random weights.
inline LawGradientCheck make_check(kernels::LawId id, Stage stage, kernels::Isa isa,
                                   std::mt19937_64& random) {
  LawGradientCheck check;
  check.law = kernels::law_table<double>(isa).laws[static_cast<int>(id)];
  for (const kernels::LawParameter& p : kernels::law_parameters(id))
    check.places.push_back(p.place);
  check.stage = stage;
  check.W1 = random_matrix(random);
  check.W2 = random_matrix(random, 1e-5);
  check.linear_in_C = id != kernels::LawId::carreau;
  if (kernels::law_has_memory(id)) check.W3 = random_matrix(random)[0];
  return check;
}

}  // namespace uniphy::testing
