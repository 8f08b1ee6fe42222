#include "uniphy/data/random_yield.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {
namespace {

using Eigen::Vector3d;

/// sinh overflows far beyond; a flow of exp(40) times its scale is as good as at once.
constexpr double kLargestArgument = 40;

YieldCap draw_cap(double shear, double bulk, double trace, UniformRandom& random) {
  YieldCap cap;
  if (random.unit() < 0.35) {
    cap.k = random.log_between(0.003, 0.3);  // plasticine: 0.0025 to 0.5
    if (random.unit() < 0.3) cap.apex = trace * random.log_between(0.05, 1);
  } else {
    cap.k = random.unit() < 0.5 ? 0 : random.log_between(1e-3, 0.1);
    cap.apex = random.unit() < 0.3 ? 0 : random.log_between(1e-4, 0.1);
    const double sine = std::sin(random.between(0.01, 0.5));
    const double alpha = std::sqrt(2.0 / 3) * 2 * sine / (3 - sine);
    cap.slope = alpha * 3 * bulk / (2 * shear);
    if (cap.apex > 0 || random.unit() < 0.3) cap.bend = random.between(0.4, 0.95);
    cap.scale = trace * random.log_between(0.1, 2);
  }
  if (random.unit() < 0.5) cap.lode = random.between(7.0 / 9, 0.98);
  if (random.unit() < 0.2 && cap.apex < trace)
    cap.crush = cap.apex + trace * random.log_between(0.3, 3);
  return cap;
}

Overstress draw_overstress(double radius, UniformRandom& random) {
  using Kind = Overstress::Kind;
  Overstress o;
  const double kind = random.unit();
  if (kind < 0.35) return o;
  o.kind = kind < 0.5    ? Kind::linear
           : kind < 0.75 ? Kind::power
           : kind < 0.9  ? Kind::sinh
                         : Kind::arsinh;
  o.exponent = random.log_between(0.3, 4);
  // At 10/s, a rate of the benchmark scenes, the overstress is between a fiftieth and five times
  // the yield stress, and the curve bends about there.
  constexpr double kRate = 10;
  const double there = radius * random.log_between(0.02, 5), bend = random.log_between(0.3, 3);
  o.strain = there / bend;
  o.rate = kRate / o.flow(there);
  return o;
}

}  // namespace

double YieldCap::returned_trace(double trace) const {
  return std::isfinite(apex) ? std::clamp(trace, apex - crush, apex) : trace;
}

double YieldCap::radius(double trace, const Vector3d& direction) const {
  const double p = std::isfinite(apex) ? std::max(0.0, apex - trace) : 0;
  double radius = k;
  if (slope > 0) radius += slope * scale * (std::pow(1 + p / scale, bend) - 1) / bend;
  if (std::isfinite(crush)) radius *= std::sqrt(std::max(0.0, 1 - (p / crush) * (p / crush)));
  const double cosine = std::sqrt(6.0) * direction.array().cube().sum();
  return radius * 2 * lode / ((1 + lode) - (1 - lode) * cosine);
}

double Overstress::flow(double beyond) const {
  const double x = std::min(beyond / strain, kind == Kind::sinh ? kLargestArgument : 1e300);
  switch (kind) {
    case Kind::none:
      break;
    case Kind::linear:
      return rate * x;
    case Kind::power:
      return rate * std::expm1(exponent * std::log1p(x)) / exponent;
    case Kind::sinh:
      return rate * std::sinh(x);
    case Kind::arsinh:
      return rate * std::asinh(x);
  }
  return beyond > 0 ? std::numeric_limits<double>::infinity() : 0;
}

double Overstress::beyond(double flow) const {
  const double y = flow / rate;
  switch (kind) {
    case Kind::none:
      break;
    case Kind::linear:
      return strain * y;
    case Kind::power:
      return strain * std::expm1(std::log1p(exponent * y) / exponent);
    case Kind::sinh:
      return strain * std::asinh(y);
    case Kind::arsinh:
      return strain * std::sinh(std::min(y, kLargestArgument));
  }
  return 0;
}

double Overstress::returned(double q, double radius, double dt) const {
  if (q <= radius) return q;
  if (kind == Kind::none) return radius;
  // What flows off falls with q' and what the rate allows grows: bisection, to the last bit.
  double low = radius, high = q;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (q - middle > dt * flow(middle - radius) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

Vector3d RandomYield::project(const Vector3d& eps, double dt) const {
  const double trace = eps.sum(), to = cap.returned_trace(trace);
  const Vector3d deviator = eps.array() - trace / 3;
  const double q = deviator.norm();
  if (q == 0) return to == trace ? eps : Vector3d(Vector3d::Constant(to / 3));
  const double radius = cap.radius(to, deviator / q);
  // Beyond the apex nothing holds the pieces together: no rate slows that down.
  const double kept = trace > cap.apex ? std::min(q, radius) : rate.returned(q, radius, dt);
  if (kept == q && to == trace) return eps;
  return (kept / q) * deviator + Vector3d::Constant(to / 3);
}

RandomYield draw_yield(double shear, double bulk, double trace, UniformRandom& random) {
  RandomYield yield;
  yield.cap = draw_cap(shear, bulk, trace, random);
  const double low = std::isfinite(yield.cap.apex) ? yield.cap.apex : 0;
  const double middle = yield.cap.returned_trace(low - 0.3 * trace);
  yield.rate =
      draw_overstress(std::clamp(yield.cap.radius(middle, Vector3d::Zero()), 1e-3, 0.3), random);
  return yield;
}

}  // namespace uniphy
