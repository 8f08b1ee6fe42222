// The signed singular value decomposition and the adjoint of its factors.

#include "ops/kernels/spectral/svd3.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <string>
#include <tuple>

#include "tests/support/factor_loss.hpp"

namespace uniphy::testing {
namespace {

using kernels::Isa;

/// Every kind of matrix that a decomposition can stumble over; entries exact in float.
std::vector<Matrix> hard_matrices() {
  std::mt19937_64 random(3);
  std::vector<Matrix> all{Matrix{},
                          identity(),
                          identity() * -1,
                          diagonal(1, 1, -1),
                          diagonal(-2, 1, 1),
                          diagonal(1, 2, 3),
                          {0, 0, 0, 0, 0, 0, 0, 0, 5},
                          {1, 1, 1, 1, 1, 1, 1, 1, 1},
                          {0, 1, 0, 0, 0, 1, 1, 0, 0},
                          {1, 0, 0, 0, 0, 0, 0, 0, -1},
                          diagonal(1e-20, 1e-20, 1e-20),
                          diagonal(1e18, 1, 1e-6)};
  for (int i = 0; i < 300; ++i) {
    all.push_back(random_matrix(random));
    all.push_back(identity() + random_matrix(random, std::pow(10.0, -(i % 16))));
    const Matrix U = random_rotation(random), V = random_rotation(random);
    for (const double gap : {0.0, 1e-12, 1e-8, 1e-4, 1.0}) {
      all.push_back(composed(U, diagonal(1 + 2 * gap, 1 + gap, 1), V));
      all.push_back(composed(U, diagonal(1 + gap, 1, -0.3), V));
    }
    all.push_back(composed(U, diagonal(1, 1e-3, 0), V));
    all.push_back(composed(U, diagonal(1, 0, 0), V));
    all.push_back(composed(U, diagonal(1, 1e-9, -1e-9), V));
    all.push_back(composed(U, diagonal(1, 1, -1), V));
  }
  for (Matrix& m : all) {
    for (double& x : m) x = float(x);
  }
  return all;
}

template <class T>
void expect_decomposition(Isa isa) {
  const double eps = 12 * double(std::numeric_limits<T>::epsilon());
  for (const Matrix& F : hard_matrices()) {
    const Factors f = decompose<T>(F, isa);
    const auto what = ::testing::PrintToString(F);
    const double size = norm(F);
    EXPECT_LE(norm(composed(f.U, f.sigma, f.V) - F), eps * size) << what;
    EXPECT_LE(norm(multiply(f.U, transposed(f.U)) - identity()), eps) << what;
    EXPECT_LE(norm(multiply(f.V, transposed(f.V)) - identity()), eps) << what;
    EXPECT_GT(det(f.U), 0.5) << what;
    EXPECT_GT(det(f.V), 0.5) << what;
    EXPECT_GE(f.sigma[0], f.sigma[4] - eps * size) << what;
    EXPECT_GE(f.sigma[4], std::abs(f.sigma[8]) - eps * size) << what;
    EXPECT_GE(f.sigma[4], 0) << what;
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> eigen(F.data());
    const Eigen::Vector3d expected = eigen.jacobiSvd().singularValues();
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(std::abs(f.sigma[4 * i]), expected[i], eps * size) << what;
    const double volume = det(F);
    if (std::abs(volume) > 1e-4 * size * size * size) {
      EXPECT_EQ(f.sigma[8] < 0, volume < 0) << what;
    }
  }
}

class Svd3OnIsa : public ::testing::TestWithParam<Isa> {};
INSTANTIATE_TEST_SUITE_P(All, Svd3OnIsa, ::testing::ValuesIn(kernels::available_isas()),
                         [](const auto& info) { return kernels::isa_name(info.param); });

TEST_P(Svd3OnIsa, IsSignedOrderedAndAccurateInDouble) { expect_decomposition<double>(GetParam()); }
TEST_P(Svd3OnIsa, IsSignedOrderedAndAccurateInFloat) { expect_decomposition<float>(GetParam()); }

// One-sided Jacobi keeps small singular values to their own size where FᵀF would square them away.
TEST_P(Svd3OnIsa, KeepsTheRelativeAccuracyOfSmallSingularValues) {
  std::mt19937_64 random(9);
  for (int i = 0; i < 50; ++i) {
    const Matrix U = random_rotation(random);
    // Scaled columns: F = U diag, so that the small values are exact in the entries.
    const Factors f = decompose<double>(multiply(U, diagonal(1, 1e-7, 1e-13)), GetParam());
    EXPECT_NEAR(f.sigma[4], 1e-7, 2e-22);
    EXPECT_NEAR(f.sigma[8], 1e-13, 3e-28);
  }
}

TEST_P(Svd3OnIsa, HandlesAnyCountAndLayout) {
  std::mt19937_64 random(15);
  const kernels::LawTable<float>& table = kernels::law_table<float>(GetParam());
  for (const std::ptrdiff_t count : {1, 2, 7, 15, 16, 17, 33}) {
    std::vector<float> planes(9 * count), rows(9 * count);
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      const Matrix m = random_matrix(random);
      for (int k = 0; k < 9; ++k) planes[k * count + p] = rows[9 * p + k] = float(m[k]);
    }
    std::vector<float> U(9 * count, 7), s(3 * count, 7), V(9 * count, 7), U2 = U, s2 = s, V2 = V;
    table.svd3(count, {rows.data(), 9, 1}, {U.data(), 9, 1}, {s.data(), 3, 1}, {V.data(), 9, 1});
    table.svd3(count, {planes.data(), 1, count}, {U2.data(), 1, count}, {s2.data(), 1, count},
               {V2.data(), 1, count});
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      for (int k = 0; k < 9; ++k) {
        EXPECT_EQ(U[9 * p + k], U2[k * count + p]);
        EXPECT_EQ(V[9 * p + k], V2[k * count + p]);
      }
    }
  }
}

template <class T>
void expect_same_alone(Isa isa) {
  const kernels::LawTable<T>& table = kernels::law_table<T>(isa);
  std::vector<T> rows;
  for (const Matrix& m : hard_matrices()) rows.insert(rows.end(), m.begin(), m.end());
  const std::ptrdiff_t count = std::ptrdiff_t(rows.size()) / 9;
  std::vector<T> U(9 * count), s(3 * count), V(9 * count);
  table.svd3(count, {rows.data(), 9, 1}, {U.data(), 9, 1}, {s.data(), 3, 1}, {V.data(), 9, 1});
  for (std::ptrdiff_t p = 0; p < count; ++p) {
    T u[9], sigma[3], v[9];
    table.svd3(1, {rows.data() + 9 * p, 9, 1}, {u, 9, 1}, {sigma, 3, 1}, {v, 9, 1});
    for (int k = 0; k < 9; ++k) EXPECT_EQ(u[k], U[9 * p + k]) << p;
    for (int k = 0; k < 3; ++k) EXPECT_EQ(sigma[k], s[3 * p + k]) << p;
    for (int k = 0; k < 9; ++k) EXPECT_EQ(v[k], V[9 * p + k]) << p;
  }
}

// Neighbours share the sweeps, and some have none left to do: what a lane gets may not depend on
// whom it is decomposed with.
TEST_P(Svd3OnIsa, NeighboursChangeNothing) {
  expect_same_alone<float>(GetParam());
  expect_same_alone<double>(GetParam());
}

TEST_P(Svd3OnIsa, ANumberThatIsNotFiniteShowsInSigma) {
  for (const double bad : {std::nan(""), double(INFINITY), -double(INFINITY)}) {
    for (int k = 0; k < 9; ++k) {
      Matrix F = {1, 0.1, 0.2, 0.3, 2, 0.1, 0.1, 0.2, 3};
      F[k] = bad;
      const Matrix s = decompose<float>(F, GetParam()).sigma;
      EXPECT_FALSE(std::isfinite(s[0] + s[4] + s[8])) << bad << " at " << k;
    }
  }
}

TEST_P(Svd3OnIsa, GradientOfTheFactorsIsExactWhereTheyAreUnique) {
  std::mt19937_64 random(21);
  for (const Matrix& s :
       {diagonal(3.1, 2, 1), diagonal(1.5, 1, 0.5), diagonal(1.4, 0.9, 1e-3),
        diagonal(1.3, 0.9, -0.4), diagonal(1.1, 1.05, 1), diagonal(1.02, 1.01, 1)}) {
    for (int i = 0; i < 5; ++i) {
      const Matrix F = composed(random_rotation(random), s, random_rotation(random));
      const FactorLoss loss{random_matrix(random), random_matrix(random), random_matrix(random),
                            random_matrix(random)};
      EXPECT_LE(loss.error(F, GetParam()), 2e-8) << ::testing::PrintToString(s);
    }
  }
}

// Where the factors are not unique the gradient is regularised: finite, bounded, still that of Σ.
TEST_P(Svd3OnIsa, GradientOfTheFactorsIsBoundedWhereTheyAreNot) {
  std::mt19937_64 random(25);
  std::vector<Matrix> sigmas{diagonal(1, 1, 1), diagonal(1, 1, -1), Matrix{},
                             diagonal(1, 0, 0), diagonal(1, 1, 0),  diagonal(1, 1e-9, -1e-9)};
  for (const double gap : {1e-12, 1e-8, 1e-4}) sigmas.push_back(diagonal(1 + 2 * gap, 1 + gap, 1));
  for (const Matrix& s : sigmas) {
    const Matrix F = composed(random_rotation(random), s, random_rotation(random));
    const FactorLoss loss{random_matrix(random), random_matrix(random), random_matrix(random),
                          random_matrix(random)};
    const Factors f = decompose<double>(F, GetParam());
    const Matrix grad = loss.gradient(f, GetParam());
    EXPECT_TRUE(std::isfinite(norm(grad))) << ::testing::PrintToString(s);
    if (s[0] > 0.5) {
      EXPECT_LE(norm(grad), 2e6) << ::testing::PrintToString(s);
      // Uᵀ (dL/dF) V has dL/dσ on its diagonal whatever happens off it.
      const Matrix frame = multiply(multiply(transposed(f.U), grad), f.V);
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(frame[4 * i], loss.W[4 * i], 1e-14 * std::max(1.0, norm(grad)));
    }
  }
}

}  // namespace
}  // namespace uniphy::testing
