#pragma once

#include <algorithm>
#include <vector>

#include "ops/kernels/laws/law_table.hpp"
#include "tests/support/finite_differences.hpp"
#include "tests/support/matrix_math.hpp"

namespace uniphy::testing {

/// F = U diag(sigma) Vᵀ by the kernel of one instruction set.
struct Factors {
  Matrix U{}, V{};
  Matrix sigma{};  ///< diagonal
};

template <class T>
Factors decompose(const Matrix& F, kernels::Isa isa) {
  T f[9], u[9], s[3], vh[9];
  std::copy(F.begin(), F.end(), f);
  kernels::law_table<T>(isa).svd3(1, {f, 9, 1}, {u, 9, 1}, {s, 3, 1}, {vh, 9, 1});
  Factors r;
  std::copy(u, u + 9, r.U.begin());
  std::copy(vh, vh + 9, r.V.begin());
  r.V = transposed(r.V);
  r.sigma = diagonal(s[0], s[1], s[2]);
  return r;
}

/// The factors are unique only up to signs: a loss that does not see them.
struct FactorLoss {
  Matrix A, B, C, W;
  Matrix D1 = diagonal(1, -2, 0.5), D2 = diagonal(0.3, 1.5, -1), D3 = diagonal(2, 1, -0.7);

  double operator()(const Factors& f) const {
    return inner(A, composed(f.U, D1, f.U)) + inner(B, composed(f.V, D2, f.V)) +
           inner(C, composed(f.U, D3, f.V)) + inner(W, f.sigma);
  }
  Matrix gradient(const Factors& f, kernels::Isa isa) const {
    const Matrix gU =
        multiply(multiply(A + transposed(A), f.U), D1) + multiply(multiply(C, f.V), D3);
    const Matrix gV =
        multiply(multiply(B + transposed(B), f.V), D2) + multiply(multiply(transposed(C), f.U), D3);
    const Matrix gVh = transposed(gV), Vh = transposed(f.V);
    const double s[3] = {f.sigma[0], f.sigma[4], f.sigma[8]}, gs[3] = {W[0], W[4], W[8]};
    Matrix grad;
    kernels::law_table<double>(isa).svd3_adjoint(1, {f.U.data(), 9, 1}, {s, 3, 1},
                                                 {Vh.data(), 9, 1}, {gU.data(), 9, 1}, {gs, 3, 1},
                                                 {gVh.data(), 9, 1}, {grad.data(), 9, 1});
    return grad;
  }

  /// Relative error of the adjoint against central differences.
  double error(const Matrix& F, kernels::Isa isa) const {
    const Matrix grad = gradient(decompose<double>(F, isa), isa);
    const auto value = [&](const std::vector<double>& x) {
      Matrix m;
      std::copy(x.begin(), x.end(), m.begin());
      return (*this)(decompose<double>(m, isa));
    };
    const auto differences = central_differences(value, std::vector<double>(F.begin(), F.end()),
                                                 std::vector<double>(9, 2e-5));
    return relative_error(std::vector<double>(grad.begin(), grad.end()), differences);
  }
};

}  // namespace uniphy::testing
