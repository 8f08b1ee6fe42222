// The learned law against central differences in float64, and its invariants by construction.

#include "ops/kernels/learned/learned_law.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>
#include <tuple>

#include "ops/kernels/base/error.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::kernels {
namespace {

using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using testing::random_weights;

/// Particles of one kind of deformation; the names are the cases of the gradient table.
struct Case {
  const char* name;
  double strain;  ///< size of log Σ
  double gap;     ///< between the two smaller singular values; negative: leave as drawn
  double floor;   ///< the least singular value; 0: leave as drawn
};

class Particles {
 public:
  Particles(const Case& c, int count, unsigned seed) : F(count), C(count), G(count), S(count) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const auto draw = [&](double scale) {
      Matrix m;
      for (int k = 0; k < 9; ++k) m.data()[k] = scale * normal(random);
      return m;
    };
    const auto rotation = [&] {
      const Eigen::Quaterniond q(normal(random), normal(random), normal(random), normal(random));
      return Matrix(q.normalized().toRotationMatrix());
    };
    for (int p = 0; p < count; ++p) {
      Eigen::Vector3d sigma;
      for (int i = 0; i < 3; ++i) sigma[i] = std::exp(c.strain * normal(random));
      std::sort(sigma.data(), sigma.data() + 3, std::greater<>());
      if (c.floor != 0) sigma[2] = c.floor;
      if (c.gap >= 0) sigma[1] = sigma[2] + c.gap;
      if (c.gap >= 0 && p % 2) sigma[0] = sigma[1] + c.gap;
      F[p] = rotation() * sigma.asDiagonal() * rotation().transpose();
      C[p] = draw(8.0);
      G[p] = draw(1.0);
      S[p] = draw(1.0);
      S[p] = (S[p] + S[p].transpose()).eval();
    }
  }
  std::vector<Matrix> F, C, G, S;  ///< S, G: weights of the scalar that is differentiated
};

View<const double> view(const std::vector<Matrix>& m) { return {m[0].data(), 9, 1}; }
View<double> view(std::vector<Matrix>& m) { return {m[0].data(), 9, 1}; }

/// L = Σ G:F_proj + S:τ / stress unit.
double loss(const LawKernel<double>& law, const Particles& p) {
  std::vector<Matrix> F(p.F.size()), tau(p.F.size());
  law.evaluate(std::ptrdiff_t(p.F.size()), 1e-4, view(p.F), view(p.C), view(F), view(tau));
  double sum = 0;
  for (std::size_t k = 0; k < F.size(); ++k)
    sum += p.G[k].cwiseProduct(F[k]).sum() + 1e-4 * p.S[k].cwiseProduct(tau[k]).sum();
  return sum;
}

struct Gradients {
  std::vector<Matrix> F, C;
  std::vector<double> z;
};
Gradients adjoint(const LawKernel<double>& law, const Particles& p) {
  Gradients g{std::vector<Matrix>(p.F.size()), std::vector<Matrix>(p.F.size(), Matrix::Zero()),
              std::vector<double>(std::size_t(law.parameter_size()))};
  std::vector<Matrix> S = p.S;
  for (Matrix& s : S) s *= 1e-4;
  std::vector<double> accumulator(std::size_t(law.accumulator_size()), 0.0);
  law.adjoint(std::ptrdiff_t(p.F.size()), 1e-4, view(p.F), view(p.C), view(p.G), view(S), view(g.F),
              view(g.C), accumulator.data(), nullptr);
  law.parameter_gradient(accumulator.data(), g.z.data());
  return g;
}

/// Fourth-order central difference of f at 0.
template <class Function>
double difference(const Function& f, double h) {
  return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

struct Error2 {
  double difference = 0, norm = 0;
  void add(double value, double expected) {
    difference += (value - expected) * (value - expected);
    norm += expected * expected;
  }
  double relative() const { return std::sqrt(difference / norm); }
};

using Parameters = std::tuple<LawForm, Activation, int>;
class LearnedLawTest : public ::testing::TestWithParam<Parameters> {
 protected:
  LawDescription description(unsigned seed, double gain = 1.0) const {
    const auto [form, activation, hidden] = GetParam();
    LawDescription d;
    d.id = LawId::learned;
    d.weights = std::make_shared<LearnedLawWeights>(random_weights(
        form, 5, form == LawForm::published ? 24 : 20, hidden, activation, seed, gain));
    d.z = {0.3, -0.2, 0.5, -0.7, 0.1};
    return d;
  }
};

void expect_gradients(const LawDescription& d) {
  const bool published_form = d.weights->form == LawForm::published;
  const Case cases[] = {
      {"generic", 0.3, -1, 0},      {"small strain", 1e-3, -1, 0},    {"gap 0", 0.2, 0, 0},
      {"gap 1e-12", 0.2, 1e-12, 0}, {"gap 1e-8", 0.2, 1e-8, 0},       {"gap 1e-4", 0.2, 1e-4, 0},
      {"gap 1", 0.2, 1, 0},         {"near-singular", 0.2, -1, 2e-3}, {"inverted", 0.2, -1, -0.2}};
  for (const Case& c : cases) {
    // The published form is not differentiable where singular values meet or F inverts: there it
    // must only be finite (the next test).
    if (published_form && (c.gap >= 0 || c.strain < 0.1) && c.gap != 1) continue;
    SCOPED_TRACE(c.name);
    const auto law = make_learned_law<double>(d);
    const int count = 70;  // more than a tile
    Particles p(c, count, 11);
    const Gradients g = adjoint(*law, p);
    Error2 of_F, of_C, of_z;
    // Where a kink (a yield surface, the clamp) falls into a stencil the difference is no
    // reference: directions whose two step sizes disagree are left out, and few may be.
    int kinks = 0, directions = 0;
    const auto compare = [&](double* at, double value, double h, Error2& error) {
      const double keep = *at;
      const auto f = [&](double step) {
        *at = keep + step;
        const double r = loss(*law, p);
        *at = keep;
        return r;
      };
      const double fine = difference(f, h), coarse = difference(f, 3 * h);
      ++directions;
      if (std::abs(fine - coarse) > 1e-6 * (std::abs(fine) + 1e-2)) {
        ++kinks;
        return;
      }
      error.add(value, fine);
    };
    for (int k = 0; k < count; k += 3)
      for (int i = 0; i < 9; ++i) {
        compare(p.F[k].data() + i, g.F[k].data()[i], 1e-5, of_F);
        compare(p.C[k].data() + i, g.C[k].data()[i], 1e-3, of_C);
      }
    LawDescription moved = d;
    int skipped = 0;
    for (int i = 0; i < 5; ++i) {
      const auto f = [&](double step) {
        moved.z[i] = d.z[i] + step;
        const double r = loss(*make_learned_law<double>(moved), p);
        moved.z[i] = d.z[i];
        return r;
      };
      const double fine = difference(f, 1e-5), coarse = difference(f, 3e-5);
      if (std::abs(fine - coarse) > 1e-6 * std::abs(fine)) {
        ++skipped;
        continue;
      }
      of_z.add(g.z[i], fine);
    }
    EXPECT_LE(of_F.relative(), 1e-6);
    EXPECT_LE(of_C.relative(), 1e-6);
    EXPECT_LE(of_z.relative(), 1e-6);
    EXPECT_GT(of_z.norm, 0);
    EXPECT_LE(kinks, directions / 10);
    EXPECT_LE(skipped, 1);
  }
}

// Shallow networks are not bounded by an activation: less gain keeps their coefficients, some of
// them exponents, where a sum over particles still shows a difference.
double gain_of(int hidden) { return hidden == 0 ? 0.05 : hidden == 1 ? 0.4 : 1.0; }

TEST_P(LearnedLawTest, GradientsMatchCentralDifferences) {
  expect_gradients(description(7, gain_of(std::get<2>(GetParam()))));
}

TEST_P(LearnedLawTest, GradientsMatchCentralDifferencesWithoutStateFeatures) {
  if (std::get<0>(GetParam()) == LawForm::published) GTEST_SKIP() << "always sees the state";
  LawDescription d = description(7, gain_of(std::get<2>(GetParam())));
  auto weights = std::make_shared<LearnedLawWeights>(*d.weights);
  const NetworkShape shape = network_shape(weights->form);
  const auto blind = [](MlpWeights& network, int features) {
    MlpWeights::Layer& first = network.layers.front();
    for (int o = 0; o < first.out; ++o)
      std::fill_n(first.weight.begin() + std::ptrdiff_t(o) * first.in, features, 0.0);
  };
  for (const bool both : {false, true}) {
    blind(weights->projection, shape.projection_in);
    if (both) blind(weights->stress, shape.stress_in);
    SCOPED_TRACE(both ? "both networks" : "projection");
    d.weights = std::make_shared<LearnedLawWeights>(*weights);
    expect_gradients(d);
  }
}

TEST_P(LearnedLawTest, GradientsAreFiniteEverywhere) {
  const auto law = make_learned_law<double>(description(3));
  Particles p({"any", 0.3, -1, 0}, 6, 5);
  p.F[0] = Matrix::Identity();
  p.F[1] = Matrix::Zero();
  p.F[2] = Matrix::Identity() * 1e-8;
  p.F[3] = Eigen::Vector3d(1, 1, -1).asDiagonal();
  p.F[4] = Eigen::Vector3d(2, 0.5, -0.5).asDiagonal();
  for (int k : {0, 1}) p.C[k].setZero();
  EXPECT_TRUE(std::isfinite(loss(*law, p)));
  const Gradients g = adjoint(*law, p);
  for (std::size_t k = 0; k < p.F.size(); ++k) {
    EXPECT_TRUE(g.F[k].allFinite()) << k;
    EXPECT_TRUE(g.C[k].allFinite()) << k;
  }
  for (double z : g.z) EXPECT_TRUE(std::isfinite(z));
}

TEST_P(LearnedLawTest, IsotropicFormIsFrameIndifferentAndSilentAtRest) {
  if (std::get<0>(GetParam()) == LawForm::published) GTEST_SKIP() << "not by construction";
  const auto law = make_learned_law<double>(description(21));
  const Particles p({"generic", 0.2, -1, 0}, 64, 9);
  Particles q = p;
  const Matrix R =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  for (std::size_t k = 0; k < p.F.size(); ++k) {
    q.F[k] = R * p.F[k];
    q.C[k] = R * p.C[k] * R.transpose();
  }
  std::vector<Matrix> F1(64), t1(64), F2(64), t2(64);
  law->evaluate(64, 1e-4, view(p.F), view(p.C), view(F1), view(t1));
  law->evaluate(64, 1e-4, view(q.F), view(q.C), view(F2), view(t2));
  for (int k = 0; k < 64; ++k) {
    // Where the law is a fluid F_proj has no orientation to turn; F Fᵀ turns in any case.
    const Matrix b1 = F1[k] * F1[k].transpose(), b2 = F2[k] * F2[k].transpose();
    EXPECT_LE((R * b1 * R.transpose() - b2).norm(), 1e-12 * b1.norm());
    EXPECT_LE((R * t1[k] * R.transpose() - t2[k]).norm(), 1e-11 * t1[k].norm());
  }
  std::vector<Matrix> F(1, Matrix::Identity()), C(1, Matrix::Zero()), out(1), tau(1);
  law->evaluate(1, 1e-4, view(F), view(C), view(out), view(tau));
  EXPECT_EQ(tau[0], Matrix::Zero().eval());
}

TEST_P(LearnedLawTest, FloatFollowsDouble) {
  const LawDescription d = description(2);
  const auto wide = make_learned_law<double>(d);
  const auto narrow = make_learned_law<float>(d);
  const Particles p({"generic", 0.2, -1, 0}, 65, 13);
  std::vector<Matrix> F(65), tau(65);
  wide->evaluate(65, 1e-4, view(p.F), view(p.C), view(F), view(tau));
  std::vector<float> f(65 * 9), c(65 * 9), fp(65 * 9), t(65 * 9);
  for (int k = 0; k < 65 * 9; ++k) {
    f[k] = float(p.F[k / 9].data()[k % 9]);
    c[k] = float(p.C[k / 9].data()[k % 9]);
  }
  narrow->evaluate(65, 1e-4f, {f.data(), 9, 1}, {c.data(), 9, 1}, {fp.data(), 9, 1},
                   {t.data(), 9, 1});
  Error2 of_F, of_tau;
  for (int k = 0; k < 65 * 9; ++k) {
    of_F.add(fp[k], F[k / 9].data()[k % 9]);
    of_tau.add(t[k], tau[k / 9].data()[k % 9]);
  }
  EXPECT_LE(of_F.relative(), 3e-5);
  EXPECT_LE(of_tau.relative(), 1e-4);
}

std::string parameter_name(const ::testing::TestParamInfo<Parameters>& info) {
  return std::string(form_name(std::get<0>(info.param))) + "_" +
         activation_name(std::get<1>(info.param)) + "_" + std::to_string(std::get<2>(info.param));
}
INSTANTIATE_TEST_SUITE_P(All, LearnedLawTest,
                         ::testing::Values(Parameters{LawForm::isotropic, Activation::gelu, 3},
                                           Parameters{LawForm::isotropic, Activation::silu, 2},
                                           Parameters{LawForm::isotropic, Activation::squareplus,
                                                      1},
                                           Parameters{LawForm::isotropic, Activation::silu, 0},
                                           Parameters{LawForm::published, Activation::gelu, 2},
                                           Parameters{LawForm::published, Activation::silu, 0}),
                         parameter_name);

TEST(LearnedLaw, RefusesWhatDoesNotFit) {
  LawDescription d;
  d.id = LawId::learned;
  EXPECT_THROW(make_learned_law<double>(d), Error);
  d.weights = std::make_shared<LearnedLawWeights>(
      random_weights(LawForm::isotropic, 4, 8, 2, Activation::silu, 1));
  d.z = {0, 0, 0};
  try {
    make_learned_law<double>(d);
    FAIL();
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "law learned: expected a latent of 4 numbers, found 3");
  }
  d.z = {0, 0, 0, std::nan("")};
  EXPECT_THROW(make_learned_law<double>(d), Error);
}

}  // namespace
}  // namespace uniphy::kernels
