#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "tests/support/matrix_math.hpp"

// What every law must satisfy, analytic or learned. Each check takes the law as simulation sees it.

namespace uniphy::testing {

/// What a law promises.
struct LawPromises {
  bool fluid = false;         ///< F_proj = J^{1/3} I instead of rotating with F
  bool idempotent = true;     ///< G(G(F)) = G(F)
  bool dissipative = true;    ///< (ε_trial − ε_proj) : τ ≥ 0
  bool elastic = false;       ///< G(F) = F, bit for bit
  double tolerance = 1e-12;   ///< relative, float64
  double stress_scale = 1e5;  ///< Pa; stresses are compared relative to it where they are smaller
};

/// One particle through a law.
struct LawState {
  Matrix F_proj{}, tau{};
};
template <class T>
LawState apply_law(const kernels::LawKernel<T>& law, double dt, const Matrix& F,
                   const Matrix& C = {}) {
  T f[9], c[9], projected[9], tau[9];
  std::copy(F.begin(), F.end(), f);
  std::copy(C.begin(), C.end(), c);
  law.evaluate(1, T(dt), {f, 9, 1}, {c, 9, 1}, {projected, 9, 1}, {tau, 9, 1});
  LawState state;
  std::copy(projected, projected + 9, state.F_proj.begin());
  std::copy(tau, tau + 9, state.tau.begin());
  return state;
}

/// Sound states: moderate strains in every mode, rotations, equal singular values.
inline std::vector<Matrix> sound_deformations(int count = 200) {
  std::mt19937_64 random(29);
  std::uniform_real_distribution<double> amplitude(-6, -0.5), strain(-1, 1);
  std::vector<Matrix> all{identity(), random_rotation(random), diagonal(1.1, 1.1, 1.1),
                          diagonal(0.9, 0.9, 0.9), diagonal(1.2, 1.2, 0.8)};
  for (int i = 0; i < count; ++i) {
    const double a = std::pow(10.0, amplitude(random));
    const Matrix s = diagonal(std::exp(a * strain(random)), std::exp(a * strain(random)),
                              std::exp(a * strain(random)));
    all.push_back(composed(random_rotation(random), s, random_rotation(random)));
  }
  return all;
}

/// States that a roll-out should never reach and must survive: singular, inverted, huge.
inline std::vector<Matrix> unsound_deformations() {
  std::mt19937_64 random(31);
  std::vector<Matrix> all{Matrix{}};
  for (const Matrix& s : {diagonal(1, 0, 0), diagonal(1, 1, 0), diagonal(1, 1, 1e-3),
                          diagonal(1, 1e-3, 1e-3), diagonal(1e-3, 1e-3, 1e-3), diagonal(1, 1, -1),
                          diagonal(1, 0.5, -0.5), diagonal(1, 1, -1e-9), diagonal(1, 1e-9, -1e-9),
                          diagonal(10, 1, 0.1), diagonal(20, 20, 20)}) {
    all.push_back(s);
    all.push_back(composed(random_rotation(random), s, random_rotation(random)));
  }
  all.push_back(diagonal(-1, -1, -1));
  return all;
}

/// ε = ½ log F Fᵀ, the Hencky strain in space.
inline Eigen::Matrix3d hencky_tensor(const Matrix& F) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> f(F.data());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(f * f.transpose());
  return eigen.eigenvectors() * (0.5 * eigen.eigenvalues().array().log()).matrix().asDiagonal() *
         eigen.eigenvectors().transpose();
}

/// Whether m is a multiple of the identity to the bit.
inline bool is_ball(const Matrix& m) {
  for (int k = 0; k < 9; ++k)
    if (m[k] != (k % 4 == 0 ? m[0] : 0.0)) return false;
  return true;
}

/// τ(QF, QCQᵀ) = Q τ Qᵀ and G(QF) = Q G(F) (a fluid: G(F)); isotropy: τ(FQ) = τ(F), G(FQ) = G(F) Q.
template <class T>
void expect_frame_indifference(const kernels::LawKernel<T>& law, double dt,
                               const LawPromises& promises) {
  std::mt19937_64 random(37);
  for (const Matrix& F : sound_deformations()) {
    const Matrix Q = random_rotation(random), C = random_matrix(random, 10);
    const LawState state = apply_law(law, dt, F, C);
    const LawState left =
        apply_law(law, dt, multiply(Q, F), multiply(multiply(Q, C), transposed(Q)));
    const LawState right = apply_law(law, dt, multiply(F, Q), C);
    const double scale = std::max(norm(state.tau), promises.stress_scale);
    const Matrix turned = multiply(multiply(Q, state.tau), transposed(Q));
    EXPECT_LE(norm(left.tau - turned), promises.tolerance * scale);
    EXPECT_LE(norm(right.tau - state.tau), promises.tolerance * scale);
    // A learned law may be a fluid at some states and a solid at others.
    const bool forgets = promises.fluid || (is_ball(state.F_proj) && is_ball(left.F_proj));
    const Matrix expected_left = forgets ? state.F_proj : multiply(Q, state.F_proj);
    const Matrix expected_right = forgets ? state.F_proj : multiply(state.F_proj, Q);
    EXPECT_LE(norm(left.F_proj - expected_left), promises.tolerance * norm(F));
    EXPECT_LE(norm(right.F_proj - expected_right), promises.tolerance * norm(F));
  }
}

/// F = I, C = 0: no stress, and F stays.
template <class T>
void expect_rest(const kernels::LawKernel<T>& law, double dt, const LawPromises& promises) {
  const LawState state = apply_law(law, dt, identity());
  EXPECT_LE(norm(state.tau), promises.tolerance * promises.stress_scale);
  EXPECT_LE(norm(state.F_proj - identity()), promises.tolerance);
}

/// τ is symmetric; G(F) = F bit for bit where the law is elastic, G(G(F)) = G(F) where it says so.
template <class T>
void expect_projection(const kernels::LawKernel<T>& law, double dt, const LawPromises& promises) {
  for (const Matrix& F : sound_deformations()) {
    const LawState state = apply_law(law, dt, F);
    EXPECT_LE(norm(state.tau - transposed(state.tau)), promises.tolerance * norm(state.tau));
    if (promises.elastic) {
      for (int k = 0; k < 9; ++k) EXPECT_EQ(T(state.F_proj[k]), T(F[k]));
    }
    if (promises.idempotent) {
      const LawState again = apply_law(law, dt, state.F_proj);
      EXPECT_LE(norm(again.F_proj - state.F_proj), 10 * promises.tolerance * norm(F));
    }
  }
}

/// Plastic flow works against the stress, (ε_trial − ε_proj) : τ ≥ 0, and so does the motion that
/// the stress depends on: (τ(F, C) − τ(F, 0)) : C ≥ 0.
template <class T>
void expect_dissipation(const kernels::LawKernel<T>& law, double dt, const LawPromises& promises) {
  std::mt19937_64 random(41);
  for (const Matrix& F : sound_deformations()) {
    const Matrix C = random_matrix(random, 10);
    const LawState still = apply_law(law, dt, F), moving = apply_law(law, dt, F, C);
    EXPECT_GE(inner(moving.tau - still.tau, C), -1e-6 * promises.stress_scale);
    if (promises.fluid) continue;
    const Eigen::Matrix3d flow = hencky_tensor(F) - hencky_tensor(still.F_proj);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> tau(still.tau.data());
    EXPECT_GE(flow.cwiseProduct(tau).sum(),
              -promises.tolerance * std::max(norm(still.tau), promises.stress_scale));
  }
}

/// Finite states give finite values and gradients; states that are not finite never look sound.
template <class T>
void expect_finite(const kernels::LawKernel<T>& law, double dt) {
  const auto finite = [](const auto& values) {
    return std::all_of(std::begin(values), std::end(values),
                       [](auto x) { return std::isfinite(double(x)); });
  };
  std::vector<Matrix> all = sound_deformations(), more = unsound_deformations();
  all.insert(all.end(), more.begin(), more.end());
  std::mt19937_64 random(43);
  for (const Matrix& F : all) {
    const LawState state = apply_law(law, dt, F, random_matrix(random));
    EXPECT_TRUE(finite(state.F_proj)) << "F = " << ::testing::PrintToString(F);
    EXPECT_TRUE(finite(state.tau)) << "F = " << ::testing::PrintToString(F);
    T f[9], c[9] = {}, gf[9], gt[9], grad_F[9], grad_C[9] = {};
    for (int k = 0; k < 9; ++k) f[k] = T(F[k]), gf[k] = T(1 + k), gt[k] = T(1e-5 * (9 - k));
    std::vector<T> sum(static_cast<std::size_t>(law.accumulator_size()), T(0));
    law.adjoint(1, T(dt), {f, 9, 1}, {c, 9, 1}, {gf, 9, 1}, {gt, 9, 1}, {grad_F, 9, 1},
                {grad_C, 9, 1}, sum.data());
    EXPECT_TRUE(finite(grad_F)) << "F = " << ::testing::PrintToString(F);
    EXPECT_TRUE(finite(grad_C)) << "F = " << ::testing::PrintToString(F);
    EXPECT_TRUE(finite(sum)) << "F = " << ::testing::PrintToString(F);
  }
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), infinity, -infinity}) {
    for (int k = 0; k < 9; ++k) {
      Matrix F = {1.1, 0.2, -0.1, 0.1, 0.9, 0.2, -0.2, 0.1, 1.2};
      F[k] = bad;
      const LawState state = apply_law(law, dt, F);
      EXPECT_FALSE(finite(state.F_proj)) << bad << " at " << k;
      EXPECT_FALSE(finite(state.tau)) << bad << " at " << k;
    }
  }
}

/// Lanes do not talk to each other: a particle's result is the same bits wherever it stands in the
/// chunk and whatever the layout. Its gradient is the same to rounding: a branch that a whole
/// vector takes may fuse products in another way.
template <class T>
void expect_independent_lanes(const kernels::LawKernel<T>& law, double dt) {
  std::vector<Matrix> all = sound_deformations(40), more = unsound_deformations();
  all.insert(all.end(), more.begin(), more.end());
  const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(all.size());
  std::vector<T> F(9 * all.size()), C(F.size(), T(0.5)), P(F.size()), tau(F.size());
  std::vector<T> grad_P(F.size()), grad_tau(F.size()), grad_F(F.size()), grad_C(F.size());
  for (std::ptrdiff_t p = 0; p < count; ++p) {
    for (int k = 0; k < 9; ++k) {
      F[k * count + p] = T(all[p][k]);
      grad_P[k * count + p] = T(1 + k);
      grad_tau[k * count + p] = T(1e-5 * (9 - k));
    }
  }
  const auto planes = [count](auto& v) {
    return kernels::View<std::remove_reference_t<decltype(v[0])>>{v.data(), 1, count};
  };
  law.evaluate(count, T(dt), planes(F), planes(C), planes(P), planes(tau));
  law.adjoint(count, T(dt), planes(F), planes(C), planes(grad_P), planes(grad_tau), planes(grad_F),
              planes(grad_C), nullptr);
  for (std::ptrdiff_t p = 0; p < count; ++p) {
    T f[9], c[9], gP[9], gt[9], alone_P[9], alone_tau[9], alone_F[9], alone_C[9] = {};
    for (int k = 0; k < 9; ++k) {
      const std::ptrdiff_t at = k * count + p;
      f[k] = F[at], c[k] = C[at], gP[k] = grad_P[at], gt[k] = grad_tau[at];
    }
    law.evaluate(1, T(dt), {f, 9, 1}, {c, 9, 1}, {alone_P, 9, 1}, {alone_tau, 9, 1});
    law.adjoint(1, T(dt), {f, 9, 1}, {c, 9, 1}, {gP, 9, 1}, {gt, 9, 1}, {alone_F, 9, 1},
                {alone_C, 9, 1}, nullptr);
    Matrix by_F, by_C, difference_F, difference_C;
    for (int k = 0; k < 9; ++k) {
      const std::ptrdiff_t at = k * count + p;
      EXPECT_EQ(alone_P[k], P[at]);
      EXPECT_EQ(alone_tau[k], tau[at]);
      by_F[k] = alone_F[k], difference_F[k] = double(alone_F[k]) - double(grad_F[at]);
      by_C[k] = alone_C[k], difference_C[k] = double(alone_C[k]) - double(grad_C[at]);
    }
    const double rounding = 1e3 * double(std::numeric_limits<T>::epsilon());
    const auto what = ::testing::PrintToString(all[p]);
    EXPECT_LE(norm(difference_F), rounding * norm(by_F)) << "F = " << what;
    EXPECT_LE(norm(difference_C), rounding * norm(by_C)) << "F = " << what;
  }
}

/// All of the above.
template <class T>
void expect_law_invariants(const kernels::LawKernel<T>& law, double dt,
                           const LawPromises& promises) {
  {
    SCOPED_TRACE("frame indifference");
    expect_frame_indifference(law, dt, promises);
  }
  {
    SCOPED_TRACE("rest");
    expect_rest(law, dt, promises);
  }
  {
    SCOPED_TRACE("projection");
    expect_projection(law, dt, promises);
  }
  if (promises.dissipative) {
    SCOPED_TRACE("dissipation");
    expect_dissipation(law, dt, promises);
  }
  {
    SCOPED_TRACE("finite");
    expect_finite(law, dt);
  }
  {
    SCOPED_TRACE("independent lanes");
    expect_independent_lanes(law, dt);
  }
}

}  // namespace uniphy::testing
