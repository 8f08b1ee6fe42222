// First derivatives of the exported law: against central differences and against the kernels'
// adjoints, at the states where singular values meet.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "models/script_check.hpp"
#include "models/torchscript.hpp"
#include "ops/base/torch.hpp"
#include "ops/learned/learned_law.hpp"
#include "tests/support/caps.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::models {
namespace {

using kernels::Activation;
using kernels::LawForm;
using ::testing::HasSubstr;
using torch::Tensor;

struct State {
  const char* name;
  Tensor F;
};

Tensor diagonal(double a, double b, double c) {
  return torch::diag(torch::tensor({a, b, c}, torch::kFloat64));
}
Tensor about_z(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return torch::tensor({c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0}, torch::kFloat64).reshape({3, 3});
}
Tensor about_x(double angle) { return about_z(angle).roll({1, 1}, {0, 1}); }
Tensor rotation(double angle) { return about_z(angle).matmul(about_x(0.4 + angle)); }

/// Singular values that meet, where the law is smooth all the same.
std::vector<State> equal_states() {
  return {{"I", diagonal(1, 1, 1)},
          {"1.3 I", diagonal(1.3, 1.3, 1.3)},
          {"R", rotation(0.7)},
          {"0.8 R", 0.8 * rotation(-0.3)},
          {"two equal", rotation(0.7).matmul(diagonal(1.2, 0.9, 0.9)).matmul(rotation(-1.1))},
          {"two equal, the larger", rotation(2.0).matmul(diagonal(1.2, 1.2, 0.9))},
          {"two equal, diagonal", diagonal(0.9, 1.2, 0.9)},
          {"I but for 1e-9", diagonal(1, 1 + 1e-9, 1 - 1e-9)}};
}
std::vector<State> apart_states() {
  return {{"diagonal", diagonal(1.25, 1.05, 0.8)},
          {"turned", rotation(0.7).matmul(diagonal(1.25, 1.05, 0.8)).matmul(rotation(1.9))},
          {"det F < 0", rotation(0.2).matmul(diagonal(1.2, 1, -0.7))}};
}
/// Where a rotation jumps, or rank is lost: derivatives are bounded by the kernels' rule.
std::vector<State> singular_states() {
  return {{"-I", -diagonal(1, 1, 1)},
          {"diag(1, 1, -1)", diagonal(1, 1, -1)},
          {"rank 2", diagonal(1, 0.7, 0)},
          {"rank 1", torch::ones({3, 3}, torch::kFloat64)},
          {"0", torch::zeros({3, 3}, torch::kFloat64)},
          {"flat", diagonal(1.2, 0.04, 0.03)}};
}
std::vector<State> all_states() {
  std::vector<State> all = equal_states();
  for (const auto& more : {apart_states(), singular_states()})
    all.insert(all.end(), more.begin(), more.end());
  return all;
}

/// Each column of central differences of fourth order.
Tensor central_difference(const std::function<double(const Tensor&)>& f, const Tensor& x) {
  const torch::NoGradGuard no_grad;
  const double h = 2e-5;
  Tensor gradient = torch::zeros_like(x);
  for (std::int64_t k = 0; k < x.numel(); ++k) {
    const auto at = [&](double step) {
      const Tensor y = x.clone();
      y.view(-1)[k] += step;
      return f(y);
    };
    gradient.view(-1)[k] = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
  }
  return gradient;
}

struct Case {
  const char* name;
  LawForm form;
  Activation activation;
  double cap;  ///< c0 of an isotropic law
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class ScriptGradient : public ::testing::TestWithParam<Case> {
 protected:
  static constexpr int kLatentSize = 4;
  ScriptGradient() : weights_(weights()), law_(of(torch::kFloat64)) {
    torch::manual_seed(11);
    z_ = 0.3 * torch::randn({kLatentSize}, torch::kFloat64);
    C_ = 5 * torch::randn({1, 3, 3}, torch::kFloat64);
    weight_ = torch::randn({1, 3, 3}, torch::kFloat64);
  }
  static std::shared_ptr<const kernels::LearnedLawWeights> weights() {
    const Case& c = GetParam();
    auto random = testing::random_weights(c.form, kLatentSize, 16, 2, c.activation, 1);
    if (c.form == LawForm::isotropic) random = testing::with_caps(random, c.cap, 3);
    return std::make_shared<kernels::LearnedLawWeights>(random);
  }
  ScriptLaw of(torch::Dtype dtype) const {
    return {script_law(*weights_, dtype), GetParam().form, kLatentSize, dtype};
  }
  using Loss = std::function<Tensor(const Tensor& F, const Tensor& C, const Tensor& z)>;
  Loss loss(const ScriptLaw& law, bool stress) const {
    return [&law, stress, this](const Tensor& F, const Tensor& C, const Tensor& z) {
      return (weight_.to(F.scalar_type()) * (stress ? law.stress(F, C, z) : law.project(F, z)))
          .sum();
    };
  }
  Loss kernel_loss(bool stress) const {
    const ops::LearnedNetworks networks = ops::to_networks(*weights_, torch::kFloat64);
    return [stress, networks, this](const Tensor& F, const Tensor& C, const Tensor& z) {
      return (weight_ * (stress ? ops::learned_stress(networks, F, C, z)
                                : ops::learned_project(networks, F, z)))
          .sum();
    };
  }
  /// dL/d(F, C, z); zeros for what does not enter.
  static std::vector<Tensor> gradients(const Loss& f, std::vector<Tensor> x) {
    for (Tensor& t : x) t = t.detach().clone().requires_grad_();
    auto g = torch::autograd::grad({f(x[0], x[1], x[2])}, x, {}, {}, false, true);
    for (std::size_t k = 0; k < x.size(); ++k)
      if (!g[k].defined()) g[k] = torch::zeros_like(x[k]);
    return g;
  }

  std::shared_ptr<const kernels::LearnedLawWeights> weights_;
  ScriptLaw law_;
  Tensor z_, C_, weight_;
};

/// Relative; of what is zero but for rounding beside an F or z of size one, the difference itself.
double difference(const Tensor& a, const Tensor& b) {
  const double scale = b.norm().item<double>();
  const double d = (a.to(torch::kFloat64) - b).norm().item<double>();
  return scale > 1e-3 ? d / scale : d;
}

TEST_P(ScriptGradient, AgreesWithCentralDifferences) {
  std::vector<State> states = apart_states();
  // The published form has no derivative where singular values meet.
  if (GetParam().form == LawForm::isotropic)
    for (const State& s : equal_states()) states.push_back(s);
  double largest = 0;
  for (const State& state : states)
    for (const bool stress : {false, true}) {
      const std::vector<Tensor> x{state.F.unsqueeze(0), C_, z_};
      const Loss f = loss(law_, stress);
      const auto g = gradients(f, x);
      for (std::size_t k = 0; k < 3; ++k) {
        const Tensor expected = central_difference(
            [&](const Tensor& y) {
              auto moved = x;
              moved[k] = y;
              return f(moved[0], moved[1], moved[2]).item<double>();
            },
            x[k]);
        const double d = difference(g[k], expected);
        EXPECT_LE(d, 1e-6) << state.name << (stress ? ", stress" : ", projection") << ", argument "
                           << k;
        if (!(d <= largest)) largest = d;
      }
    }
  std::printf("[ measured ] %s: %.1e of central differences\n", GetParam().name, largest);
}

TEST_P(ScriptGradient, IsTheKernelsEverywhere) {
  std::vector<State> states = all_states();
  // Where singular values meet, U and V of a turned F are a matter of the last bit, and the
  // published form is another one with each. These have the same U and V here and there.
  if (GetParam().form == LawForm::published) {
    states = apart_states();
    for (const State& s : singular_states())
      if (std::string(s.name) != "rank 1") states.push_back(s);  // two singular values of 0
    for (const State& s :
         {State{"I", diagonal(1, 1, 1)}, State{"1.3 I", diagonal(1.3, 1.3, 1.3)},
          State{"R about z", about_z(0.7)}, State{"0.8 R about x", 0.8 * about_x(-0.3)},
          State{"two equal", about_z(0.7).matmul(diagonal(1.2, 1.2, 0.9))},
          State{"two equal, diagonal", diagonal(0.9, 1.2, 0.9)}})
      states.push_back(s);
  }
  double largest = 0;
  for (const State& state : states)
    for (const bool stress : {false, true}) {
      const std::vector<Tensor> x{state.F.unsqueeze(0), C_, z_};
      const auto g = gradients(loss(law_, stress), x);
      const auto expected = gradients(kernel_loss(stress), x);
      for (std::size_t k = 0; k < 3; ++k) {
        const double d = difference(g[k], expected[k]);
        EXPECT_LE(d, 1e-9) << state.name << (stress ? ", stress" : ", projection") << ", argument "
                           << k << "\n"
                           << g[k] << "\n"
                           << expected[k];
        if (!(d <= largest)) largest = d;
      }
    }
  std::printf("[ measured ] %s: %.1e of the kernels' gradients\n", GetParam().name, largest);
}

TEST_P(ScriptGradient, IsFiniteInSinglePrecision) {
  const ScriptLaw law = of(torch::kFloat32);
  for (const State& state : all_states())
    for (const bool stress : {false, true}) {
      const auto g = gradients(loss(law, stress), {state.F.unsqueeze(0).to(torch::kFloat32),
                                                   C_.to(torch::kFloat32), z_.to(torch::kFloat32)});
      for (const Tensor& t : g) EXPECT_TRUE(torch::isfinite(t).all().item<bool>()) << state.name;
    }
  // Away from the states where a rounding decides, the numbers agree too.
  for (const State& state : apart_states()) {
    const std::vector<Tensor> x{state.F.unsqueeze(0), C_, z_};
    const auto expected = gradients(loss(law_, true), x), g = gradients(loss(law, true), x);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_LE(difference(g[k], expected[k]), 1e-2) << k;
  }
}

/// A file's later calls are compiled by what the first ones saw, by LibTorch 2 with other
/// roundings: they must be right, and not take minutes (the time limit of the test).
TEST_P(ScriptGradient, LaterCallsOfManyParticlesAgreeWithTheFirst) {
  const Probe probe = probe_states(300, 3);
  std::vector<Tensor> first;
  for (int call = 0; call < 4; ++call) {
    const Tensor F = probe.F.clone().requires_grad_(), C = probe.C.clone().requires_grad_();
    const Tensor z = z_.clone().requires_grad_();
    const Tensor F_proj = law_.project(F, z), tau = law_.stress(F_proj, C, z);
    const auto g =
        torch::autograd::grad({(weight_ * F_proj).sum() + 1e-4 * (weight_ * tau).sum()}, {F, C, z});
    std::vector<Tensor> now{F_proj.detach(), tau.detach(), g[0], g[1], g[2]};
    // In between, what needs no gradient gets none.
    const Tensor plain = law_.project(probe.F, z_);
    EXPECT_FALSE(plain.requires_grad());
    EXPECT_LE(difference(plain, now[0]), 1e-13);
    EXPECT_LE(difference(law_.stress(plain, probe.C, z_), now[1]), 1e-11);
    {
      const torch::NoGradGuard no_grad;
      EXPECT_FALSE(law_.project(F, z).requires_grad());
    }
    if (first.empty()) first = now;
    for (std::size_t k = 0; k < now.size(); ++k)
      EXPECT_LE(difference(now[k], first[k]), 1e-11) << call << ", " << k;
  }
}

TEST_P(ScriptGradient, ACodeForEachParticle) {
  const Probe probe = probe_states(3, 5);
  const Tensor z = 0.3 * torch::randn({3, kLatentSize}, torch::kFloat64);
  const auto together = gradients(loss(law_, true), {probe.F, probe.C, z});
  for (int p = 0; p < 3; ++p) {
    const auto alone =
        gradients(loss(law_, true), {probe.F.slice(0, p, p + 1), probe.C.slice(0, p, p + 1), z[p]});
    EXPECT_LE(difference(together[0][p], alone[0][0]), 1e-10);
    EXPECT_LE(difference(together[2][p], alone[2]), 1e-10);
  }
}

/// What could only be wrong is refused.
TEST_P(ScriptGradient, ASecondDerivativeThroughFIsRefused) {
  for (const bool stress : {false, true}) {
    const Tensor F = diagonal(1.25, 1.05, 0.8).unsqueeze(0).requires_grad_();
    const Tensor z = z_.clone().requires_grad_(), C = C_.clone().requires_grad_();
    const std::vector<Tensor> x = stress ? std::vector<Tensor>{F, z, C} : std::vector<Tensor>{F, z};
    for (const Tensor& first : x)
      for (const Tensor& second : x) {
        const Tensor y = loss(law_, stress)(F, C, z);
        const Tensor g = torch::autograd::grad({y}, {first}, {}, {}, true)[0];
        try {
          torch::autograd::grad({g.square().sum()}, {second}, {}, {}, false, true);
          FAIL() << "a second derivative was answered";
        } catch (const c10::Error& e) {
          EXPECT_THAT(e.what(), HasSubstr("derivative for '_cdist_backward' is not implemented"));
        }
      }
  }
  // Without a gradient of F, the second derivative by z is an ordinary one.
  const Tensor F = diagonal(1.25, 1.05, 0.8).unsqueeze(0), z = z_.clone().requires_grad_();
  const Loss f = loss(law_, true);
  const auto slope = [&](const Tensor& at) {
    return torch::autograd::grad({f(F, C_, at)}, {at}, {}, {}, true)[0];
  };
  const Tensor second = torch::autograd::grad({slope(z)[0]}, {z})[0];
  const double h = 1e-5;
  for (int k = 0; k < kLatentSize; ++k) {
    const auto at = [&](double step) {
      Tensor moved = z_.clone();
      moved[k] += step;
      return slope(moved.requires_grad_())[0].item<double>();
    };
    const double expected = (at(h) - at(-h)) / (2 * h);
    EXPECT_NEAR(second[k].item<double>(), expected, 1e-5 * second.norm().item<double>());
  }
}

TEST_P(ScriptGradient, NoParticlesNoGradient) {
  const Tensor F = torch::zeros({0, 3, 3}, torch::kFloat64);
  for (const bool stress : {false, true}) {
    const auto g = gradients(loss(law_, stress), {F, F, z_});
    EXPECT_EQ(g[0].sizes(), F.sizes());
    EXPECT_EQ(g[2].norm().item<double>(), 0);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, ScriptGradient,
    ::testing::Values(Case{"isotropic_elastic_at_rest", LawForm::isotropic, Activation::gelu, 1.5},
                      Case{"isotropic_viscoplastic_at_rest", LawForm::isotropic, Activation::silu,
                           -0.25},
                      Case{"isotropic_fluid", LawForm::isotropic, Activation::squareplus, -1.5},
                      Case{"published_gelu", LawForm::published, Activation::gelu, 0},
                      Case{"published_squareplus", LawForm::published, Activation::squareplus, 0}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace uniphy::models
