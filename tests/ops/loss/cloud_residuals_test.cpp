// Distances of particles from clouds against plain tensors, central differences and closed answers.

#include "ops/loss/cloud_residuals.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "ops/base/torch.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/on_threads.hpp"
#include "tests/support/tensors.hpp"

namespace uniphy::ops {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;
using torch::indexing::Slice;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr CloudDistance kDistances[] = {CloudDistance::nearest, CloudDistance::chamfer,
                                        CloudDistance::transport};

/// Three frames of 5, 0 and 9 points, in rows anywhere among 9; 7 particles of different weight.
struct Scene {
  Tensor clouds, weights, x;
  CloudSettings settings{CloudDistance::transport, 0.05, 3};

  explicit Scene(CloudDistance distance = CloudDistance::transport) {
    torch::manual_seed(7);
    clouds = 0.4 + 0.2 * torch::rand({3, 9, 3}, torch::kFloat64);
    clouds.index_put_({0, torch::tensor({0, 3, 4, 7})}, kNaN);
    clouds.index_put_({1}, kNaN);
    weights = 1e-6 * (0.5 + torch::rand({7}, torch::kFloat64));
    x = (0.42 + 0.2 * torch::rand({3, 7, 3}, torch::kFloat64)).requires_grad_();
    settings.distance = distance;
  }
  CloudTargets targets() const { return {clouds, weights, settings}; }
  Tensor residuals() const { return targets().residuals(x); }
  Tensor points(std::int64_t frame) const {
    const Tensor cloud = clouds[frame];
    return cloud.index({torch::isfinite(cloud.index({Slice(), 0}))});
  }
};

/// The same by matrices of all pairs.
namespace dense {

Tensor squares(const Tensor& x, const Tensor& y) {
  return (x.unsqueeze(1) - y.unsqueeze(0)).square().sum(2);
}
Tensor one_side(const Tensor& x, const Tensor& y) {
  return y.index_select(0, squares(x, y).argmin(1));
}

Tensor nearest(const Scene& s, std::int64_t frame) {
  const Tensor r = torch::zeros({9, 3}, torch::kFloat64), x = s.x[frame], y = s.points(frame);
  const Tensor rows = torch::isfinite(s.clouds[frame].index({Slice(), 0}));
  return r.index_put({rows}, (one_side(y, x) - y) / std::sqrt(y.size(0))).flatten();
}
Tensor chamfer(const Scene& s, std::int64_t frame) {
  const Tensor w = (s.weights / s.weights.sum()).sqrt().unsqueeze(1), x = s.x[frame];
  const Tensor particles = w * (x - one_side(x, s.points(frame)));
  return std::sqrt(0.5) * torch::cat({nearest(s, frame), particles.flatten()});
}

Tensor exponents(const Tensor& rows, const Tensor& columns, const Tensor& log_weights,
                 const Tensor& potentials, double epsilon) {
  return log_weights + (potentials - 0.5 * squares(rows, columns)) / epsilon;
}
Tensor softmin(const Tensor& rows, const Tensor& columns, const Tensor& log_weights,
               const Tensor& potentials, double epsilon) {
  return -epsilon * exponents(rows, columns, log_weights, potentials, epsilon).logsumexp(1);
}
Tensor transport(const Tensor& x, const Tensor& y, const Tensor& w, double extent, double blur,
                 int iterations) {
  std::vector<double> lengths;
  for (double length = extent; length > blur; length /= 2) lengths.push_back(length);
  lengths.insert(lengths.end(), iterations, blur);
  const Tensor a = w.log(), b = torch::full({y.size(0)}, -std::log(y.size(0)), w.options());
  Tensor f = torch::zeros_like(a), g = torch::zeros_like(b), p = f;
  for (std::size_t t = 0; t < lengths.size(); ++t) {
    const double e = lengths[t] * lengths[t], share = t == 0 ? 1 : 0.5;
    const Tensor F = softmin(x, y, b, g, e), G = softmin(y, x, a, f, e), P = softmin(x, x, a, p, e);
    f = (1 - share) * f + share * F;
    g = (1 - share) * g + share * G;
    p = (1 - share) * p + share * P;
  }
  const double e = blur * blur;
  const Tensor of_itself = exponents(x, x, a, p, e).softmax(1).matmul(x);
  const Tensor of_cloud = exponents(x, y, b, g, e).softmax(1).matmul(y);
  return (w.sqrt().unsqueeze(1) * (of_itself - of_cloud)).flatten();
}
Tensor transport(const Scene& s, std::int64_t frame) {
  double extent = 0;
  for (const std::int64_t f : {0, 2}) {
    const Tensor y = s.points(f);
    extent = std::max(
        extent, (std::get<0>(y.max(0)) - std::get<0>(y.min(0))).norm().template item<double>());
  }
  return transport(s.x[frame], s.points(frame), s.weights / s.weights.sum(), extent,
                   s.settings.blur, s.settings.iterations);
}

Tensor residuals(const Scene& s, std::int64_t frame) {
  if (s.settings.distance == CloudDistance::nearest) return nearest(s, frame);
  return s.settings.distance == CloudDistance::chamfer ? chamfer(s, frame) : transport(s, frame);
}

}  // namespace dense

TEST(CloudResiduals, ValuesAndGradientsMatchMatricesOfAllPairs) {
  for (const CloudDistance distance : kDistances) {
    const Scene s(distance);
    const Tensor got = s.residuals(), seed = torch::rand_like(got);
    ASSERT_EQ(got.size(1), s.targets().residuals_per_frame());
    EXPECT_EQ(got[1].abs().sum().item<double>(), 0) << "a frame without a point";
    Tensor loss = torch::zeros({}, torch::kFloat64);
    for (const std::int64_t frame : {0, 2}) {
      const Tensor want = dense::residuals(s, frame);
      EXPECT_LE(testing::relative_difference(got[frame], want), 1e-11) << int(distance);
      loss = loss + (seed[frame] * want).sum();
    }
    const Tensor gradient = torch::autograd::grad({(seed * got).sum()}, {s.x})[0];
    const Tensor expected = torch::autograd::grad({loss}, {s.x})[0];
    EXPECT_LE(testing::relative_difference(gradient, expected), 1e-10) << int(distance);
  }
}

TEST(CloudResiduals, GradientsAgreeWithCentralDifferences) {
  for (const CloudDistance distance : kDistances) {
    const Scene s(distance);
    const CloudTargets targets = s.targets();
    const auto loss = [&](const Tensor& x) { return targets.residuals(x).square().sum(); };
    const Tensor gradient = torch::autograd::grad({loss(s.x)}, {s.x})[0];
    EXPECT_GT(gradient.norm().item<double>(), 0);
    EXPECT_LE(testing::relative_difference(gradient, testing::numerical_gradient(loss, s.x, 1e-5)),
              1e-8)
        << int(distance);
  }
}

TEST(CloudResiduals, TakesTheFirstFramesAlone) {
  for (const CloudDistance distance : kDistances) {
    const Scene s(distance);
    const Tensor first = s.targets().residuals(s.x.index({Slice(0, 1)}));
    EXPECT_TRUE(torch::equal(first[0], s.residuals()[0]));
  }
}

TEST(CloudResiduals, RowsOfTheCloudThatAreMissingGiveZero) {
  const Scene s(CloudDistance::chamfer);
  const Tensor r = s.residuals()[0].index({Slice(0, 27)}).view({9, 3});
  const Tensor hidden = torch::isnan(s.clouds[0]);
  EXPECT_EQ(r.index({hidden}).abs().sum().item<double>(), 0);
  EXPECT_GT(r.index({~hidden}).abs().min().item<double>(), 0);
}

TEST(CloudResiduals, VanishWhereTheParticlesAreTheCloud) {
  for (const CloudDistance distance : kDistances) {
    Scene s(distance);
    s.settings.blur = 0.01;
    s.weights = torch::full({9}, 2.5, torch::kFloat64);
    const Tensor order = torch::randperm(9);
    s.x = s.clouds.index({Slice(2, 3), order});
    s.clouds = s.clouds.index({Slice(2, 3)});
    EXPECT_LE(s.residuals().abs().max().item<double>(), 1e-15) << int(distance);
  }
}

/// [points, 3], in a box of 0.2 m.
Tensor random_points(std::int64_t points) {
  return 0.4 + 0.2 * torch::rand({points, 3}, torch::kFloat64);
}
Tensor even_weights(std::int64_t particles) { return torch::ones({particles}, torch::kFloat64); }

TEST(CloudResiduals, TransportOfAMovedCopyIsItsTranslation) {
  torch::manual_seed(3);
  const Tensor x = random_points(60), way = torch::tensor({0.05, -0.3, 0.1}, torch::kFloat64);
  const CloudTargets targets((x + way).unsqueeze(0), even_weights(60),
                             {CloudDistance::transport, default_blur(8e-3, 60), 4});
  const Tensor r = std::sqrt(60) * targets.residuals(x.unsqueeze(0)).view({60, 3});
  EXPECT_LE((r + way).abs().max().item<double>(), 0.02 * way.norm().item<double>());
}

TEST(CloudResiduals, SquaredTransportIsThatOfTheBestAssignment) {
  constexpr int kPoints = 6;
  torch::manual_seed(5);
  const Tensor x = random_points(kPoints), y = random_points(kPoints);
  const Tensor cost = dense::squares(x, y);
  std::array<int, kPoints> to{};
  std::iota(to.begin(), to.end(), 0);
  double least = std::numeric_limits<double>::infinity();
  do {
    double sum = 0;
    for (int i = 0; i < kPoints; ++i) sum += cost[i][to[i]].item<double>() / kPoints;
    least = std::min(least, sum);
  } while (std::next_permutation(to.begin(), to.end()));
  const CloudTargets targets(y.unsqueeze(0), even_weights(kPoints),
                             {CloudDistance::transport, 0.005, 3000});
  const double got = targets.residuals(x.unsqueeze(0)).square().sum().item<double>();
  EXPECT_NEAR(got, least, 0.02 * least);
}

TEST(CloudResiduals, SameBitsOnOneThreadAndTwo) {
  for (const CloudDistance distance : kDistances) {
    const Scene s(distance);
    const auto run = [&] {
      const Tensor r = s.residuals();
      return torch::cat(
                 {r.flatten(), torch::autograd::grad({r.square().sum()}, {s.x})[0].flatten()})
          .detach();
    };
    EXPECT_TRUE(torch::equal(testing::on_threads(1, run), testing::on_threads(2, run)));
  }
}

TEST(CloudResiduals, AFrameThatIsNotFiniteIsNaNAlone) {
  for (const CloudDistance distance : kDistances) {
    Scene s(distance);
    s.x = s.x.detach().clone();
    s.x.index_put_({2, 4, 1}, kNaN);
    s.x.requires_grad_();
    const Tensor r = s.residuals();
    EXPECT_TRUE(torch::isnan(r[2]).all().item<bool>());
    EXPECT_TRUE(torch::isfinite(r[0]).all().item<bool>());
    const Tensor gradient = torch::autograd::grad({r.square().sum()}, {s.x})[0];
    EXPECT_TRUE(torch::isnan(gradient[2]).all().item<bool>());
    EXPECT_TRUE(torch::isfinite(gradient[0]).all().item<bool>());
  }
}

TEST(CloudResiduals, IsDifferentiableOnce) {
  const Scene s;
  EXPECT_THAT(testing::error_of([&] {
                torch::autograd::grad({s.residuals().square().sum()}, {s.x}, {}, true, true);
              }),
              HasSubstr("cloud_residuals: is differentiable once"));
}

TEST(CloudResiduals, RefuseWhatDoesNotFit) {
  const auto message = [](const auto& change) {
    Scene s;
    change(s);
    return testing::error_of([&] { s.residuals(); });
  };
  const auto expect = [&](const auto& change, const std::string& part) {
    EXPECT_THAT(message(change), HasSubstr("cloud_residuals: " + part));
  };
  const auto put = [](Tensor& t, std::int64_t at, double value) {
    t = t.detach().clone();
    t.flatten()[at] = value;
  };
  expect([](Scene& s) { s.clouds = s.clouds[0]; },
         "clouds: expected [any, any, 3] Double on cpu, found [9, 3] Double");
  expect([](Scene& s) { s.clouds = s.clouds.to(torch::kFloat32); }, "clouds: expected [any, any");
  expect([&](Scene& s) { put(s.clouds, 4, kNaN); },
         "clouds: expected three finite coordinates, or three NaN, found nan in row 1 of frame 0");
  expect([&](Scene& s) { put(s.clouds, 3, std::numeric_limits<double>::infinity()); },
         "clouds: expected three finite coordinates, or three NaN, found inf in row 1 of frame 0");
  expect([](Scene& s) { s.clouds = torch::full_like(s.clouds, kNaN); },
         "clouds: expected a point in at least one frame, found NaN alone");
  expect([](Scene& s) { s.weights = s.weights.to(torch::kFloat32); },
         "weights: expected [any] Double on cpu, found [7] Float");
  expect([&](Scene& s) { put(s.weights, 2, -1); },
         "weights: expected finite numbers > 0, found -1.000000 of particle 2");
  expect([&](Scene& s) { put(s.weights, 6, kNaN); },
         "weights: expected finite numbers > 0, found nan of particle 6");
  expect([](Scene& s) { s.weights = s.weights.index({Slice(0, 0)}); },
         "weights: expected at least one particle");
  expect(
      [](Scene& s) {
        s.x = s.x.index({Slice(), Slice(0, 6)});
      },
      "x: expected [any, 7, 3] Double on cpu, found [3, 6, 3] Double");
  expect(
      [](Scene& s) {
        s.x = torch::cat({s.x, s.x});
      },
      "x: expected at most 3 frames, found [6, 7, 3] Double");
  expect([](Scene& s) { s.settings.blur = 0; }, "blur: expected a length > 0 m, found 0.0000");
  expect([](Scene& s) { s.settings.iterations = 0; }, "iterations: expected at least 1, found 0");
}

}  // namespace
}  // namespace uniphy::ops
