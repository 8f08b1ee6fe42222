#include "uniphy/stability/spectral_states.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

namespace uniphy::stability {
namespace {

using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

StabilityOptions small() {
  StabilityOptions o;
  o.spectral_states = 300;
  o.spectral_condition = 1e8;
  return o;
}

template <class F>
void each(const char* stressor, const F& f) {
  int sets = 0;
  for (const StateSet& set : spectral_states(small())) {
    if (set.stressor != stressor) continue;
    ++sets;
    for (std::int64_t p = 0; p < set.size(); ++p) {
      const Matrix A = Eigen::Map<const Matrix>(&set.F[static_cast<std::size_t>(9 * p)]);
      f(p, A, Eigen::Vector3d(A.jacobiSvd().singularValues()));
    }
  }
  EXPECT_EQ(sets, 1) << stressor;
}

TEST(SpectralStates, HaveTheSingularValuesThatTheyAreNamedFor) {
  each("equal_values", [](std::int64_t p, const Matrix&, const Eigen::Vector3d& s) {
    EXPECT_LT(p % 2 == 0 ? s[0] - s[1] : s[1] - s[2], 1e-14);
    EXPECT_GT(s[0] - s[2], 0.1);
  });
  int close = 0, far = 0;
  each("near_equal_values", [&](std::int64_t p, const Matrix&, const Eigen::Vector3d& s) {
    const double gap = p % 2 == 0 ? s[0] - s[1] : s[1] - s[2];
    close += gap < 1e-10 ? 1 : 0;
    far += gap > 1e-6 ? 1 : 0;
    EXPECT_LT(gap, 1.1e-2);
  });
  EXPECT_GT(close, 10);
  EXPECT_GT(far, 10);
  each("rotation", [](std::int64_t, const Matrix& F, const Eigen::Vector3d&) {
    const double away = (F.transpose() * F - Matrix::Identity()).norm();
    EXPECT_GT(away, 1e-9);
    EXPECT_LT(away, 2e-6);
  });
  each("inverted", [](std::int64_t, const Matrix& F, const Eigen::Vector3d&) {
    EXPECT_LT(F.determinant(), 0);
  });
  each("rank_loss",
       [](std::int64_t, const Matrix&, const Eigen::Vector3d& s) { EXPECT_LT(s[2], 1e-15); });
  double worst = 0;
  each("random_states", [&](std::int64_t, const Matrix&, const Eigen::Vector3d& s) {
    worst = std::max(worst, s[0] / s[2]);
  });
  EXPECT_GT(worst, 1e7);
  EXPECT_LT(worst, 1.1e8);
}

TEST(SpectralStates, FollowTheSeed) {
  StabilityOptions o = small();
  const auto a = spectral_states(o), b = spectral_states(o);
  o.seed = 2;
  const auto c = spectral_states(o);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(a.back().F, b.back().F);
  EXPECT_NE(a.back().F, c.back().F);
}

}  // namespace
}  // namespace uniphy::stability
