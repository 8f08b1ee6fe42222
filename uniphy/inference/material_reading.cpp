#include "uniphy/inference/material_reading.hpp"

#include <Eigen/Core>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <memory>

namespace uniphy {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Compression (−log Σ of each axis) under which shear is small: sand bears it, and nothing yields.
constexpr double kCompression = 1e-3;
/// Logarithmic strain that counts as small, far below the least yield strain of the families.
constexpr double kSmall = 1e-6;
/// Pressures at which yield is looked for, as −tr ε.
constexpr double kPressed = 0.02, kUnpressed = 1e-6;
/// A material that yields under next to no pressure at less than this part of what it bears under
/// kPressed is sand: of a von Mises solid it is 1.
constexpr double kSandShare = 0.2;
/// rad. Sand that a slope of less lets slide is a fluid; the families' least friction is 0.01.
constexpr double kLeastFriction = 0.005;
/// Share of what exceeds the yield strain that is left after a step, from which a flow has a rate.
/// A choice: the two families meet where a non-Newtonian body's viscosity is small.
constexpr double kFlowShare = 0.03;
/// Share of that excess which has to flow off while a body is observed, for a flow. A choice: of
/// the non-Newtonian bodies of the families, it does within a millisecond.
constexpr double kFlowSeen = 0.1;
/// 1/s, of shear.
constexpr double kRate = 10;

/// A law at one particle.
class Probe {
 public:
  Probe(const kernels::LawDescription& law, double dt)
      : law_(kernels::make_law<double>(law)), dt_(dt) {}

  struct Answer {
    Vector3d strain;  ///< log Σ of the projected F, in the axes of the probe
    Matrix3d tau;
  };
  /// At F = diag(exp(log_sigma)).
  Answer at(const Vector3d& log_sigma, const Matrix3d& C = Matrix3d::Zero()) const {
    RowMatrix F = log_sigma.array().exp().matrix().asDiagonal().toDenseMatrix(), rate = C, F_proj,
              tau;
    double before = 0, after = 0;
    const auto view = [](auto* data) {
      return kernels::View<std::remove_pointer_t<decltype(data)>>{data, 9, 1};
    };
    law_->evaluate(1, dt_, view(static_cast<const double*>(F.data())),
                   view(static_cast<const double*>(rate.data())), view(F_proj.data()),
                   view(tau.data()), {view(static_cast<const double*>(&before)), view(&after)});
    return {F_proj.diagonal().array().abs().max(1e-300).log().matrix(), tau};
  }
  /// A shear of norm q in the plane of the first two axes, at tr ε = −pressed.
  static Vector3d shear(double q, double pressed) {
    return Vector3d(q / std::sqrt(2.0), -q / std::sqrt(2.0), 0) - Vector3d::Constant(pressed / 3);
  }
  /// Norm of the deviator that is left of such a shear.
  double left(double q, double pressed) const {
    const Vector3d strain = at(shear(q, pressed)).strain;
    return (strain.array() - strain.mean()).matrix().norm();
  }
  /// The least q up to `most` of which the projection takes something; infinite where there is
  /// none.
  double yield_strain(double pressed, double most) const {
    constexpr int kSteps = 200;
    constexpr double kLeast = 1e-7, kTaken = 1e-6;
    const auto yields = [&](double q) { return left(q, pressed) < (1 - kTaken) * q; };
    double low = 0, high = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= kSteps && std::isinf(high); ++k) {
      const double q = kLeast * std::pow(most / kLeast, double(k) / kSteps);
      (yields(q) ? high : low) = q;
    }
    for (int k = 0; k < 40 && std::isfinite(high); ++k) {
      const double middle = 0.5 * (low + high);
      (yields(middle) ? high : low) = middle;
    }
    return high;
  }

 private:
  std::shared_ptr<const kernels::LawKernel<double>> law_;
  double dt_;
};

/// Of small strains under a compression; without one they are what two of them lead to in a line.
struct Moduli {
  double bulk, mu;  ///< Pa
  double left;      ///< of a shear of 2 kSmall
};
Moduli moduli(const Probe& probe, double compression) {
  const auto pressure = [&](double h) { return -probe.at(Vector3d::Constant(-h)).tau.trace() / 3; };
  const Vector3d shear(kSmall, -kSmall, 0);
  const Probe::Answer sheared = probe.at(Vector3d::Constant(-compression) + shear);
  return {(pressure(compression + kSmall) - pressure(compression - kSmall)) / (6 * kSmall),
          (sheared.tau(0, 0) - sheared.tau(1, 1)) / (4 * kSmall),
          sheared.strain[0] - sheared.strain[1]};
}

void read_fluid(const Probe& probe, double bulk, MaterialReading& m) {
  const double strain_seen = m.strain_seen;
  m = {};
  m.strain_seen = strain_seen;
  m.material = "newtonian";
  m.lambda = bulk;
  Matrix3d C = Matrix3d::Zero();
  C(0, 1) = kRate;
  m.viscosity = probe.at(Vector3d::Zero(), C).tau(0, 1) / kRate;
}

/// Of a solid whose moduli are known.
void read_yield(const Probe& probe, double dt, double duration, MaterialReading& m) {
  const double pressed = probe.yield_strain(kPressed, m.strain_seen);
  const double free = probe.yield_strain(kUnpressed, m.strain_seen);
  m.material = "elastic";
  if (std::isinf(free)) return;
  if (free < kSandShare * std::min(pressed, kPressed)) {
    m.material = "sand";
    if (std::isinf(pressed)) return;
    // ‖ε̂‖ = α (3λ + 2μ)/(2μ) |tr ε|, α = √(2/3) 2 sin θ/(3 − sin θ)
    const double alpha =
        (pressed - free) / (kPressed - kUnpressed) * 2 * m.mu / (3 * m.lambda + 2 * m.mu);
    const double s = alpha * std::sqrt(1.5);
    m.friction_angle = std::asin(std::clamp(3 * s / (2 + s), 0.0, 1.0));
    if (m.friction_angle < kLeastFriction) {
      read_fluid(probe, m.lambda + 2 * m.mu / 3, m);
      return;
    }
    // The cone meets the deviator at ‖s₀‖ = 2√6 c cos θ/(3 − sin θ) where there is no pressure.
    const double slope = (pressed - free) / (kPressed - kUnpressed);
    const double s0 = 2 * m.mu * std::max(0.0, free - slope * kUnpressed);
    m.cohesion =
        s0 * (3 - std::sin(m.friction_angle)) / (2 * std::sqrt(6.0) * std::cos(m.friction_angle));
    return;
  }
  const double excess = 0.5 * free, kept = (probe.left(free + excess, 0) - free) / excess;
  if (std::pow(kept, duration / dt) > 1 - kFlowSeen) return;
  const Probe::Answer at = probe.at(Probe::shear(free, 0));
  m.yield_stress = (at.tau - at.tau.trace() / 3 * Matrix3d::Identity()).norm();
  m.material = kept < kFlowShare ? "plasticine" : "non_newtonian";
  if (kept < kFlowShare) return;
  // What is left of the excess is 1/(1 + 2 μ̂ Δt/η), μ̂ = μ/3 tr Σ².
  const Vector3d squares = (2 * Probe::shear(free + excess, 0)).array().exp();
  const double mu_hat = m.mu / 3 * squares.sum();
  m.viscosity = kept < 1 ? 2 * mu_hat * dt * kept / (1 - kept) : MaterialReading::kNone;
}

}  // namespace

MaterialReading read_material(const kernels::LawDescription& law, double dt, double strain,
                              double duration) {
  MaterialReading m;
  m.strain_seen = std::clamp(strain, 1e-6, 2.0);
  const Probe probe(law, dt);
  const Moduli at = moduli(probe, kCompression), twice = moduli(probe, 2 * kCompression);
  const double bulk = 2 * at.bulk - twice.bulk;
  if (at.left < kSmall) {  // of 2 kSmall
    read_fluid(probe, bulk, m);
    return m;
  }
  m.mu = 2 * at.mu - twice.mu;
  m.lambda = bulk - 2 * m.mu / 3;
  m.young = 9 * bulk * m.mu / (3 * bulk + m.mu);
  m.poisson = (3 * bulk - 2 * m.mu) / (2 * (3 * bulk + m.mu));
  read_yield(probe, dt, duration, m);
  return m;
}

double strain_seen(const std::vector<double>& F) {
  std::vector<double> q;
  for (std::size_t k = 0; k + 8 < F.size(); k += 9) {
    const Eigen::Map<const RowMatrix> matrix(F.data() + k);
    const Vector3d log =
        Eigen::JacobiSVD<Matrix3d>(matrix).singularValues().array().max(1e-12).log();
    q.push_back((log.array() - log.mean()).matrix().norm());
  }
  if (q.empty()) return 0;
  const auto at =
      q.begin() + static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(q.size() - 1));
  std::nth_element(q.begin(), at, q.end());
  return *at;
}

const std::vector<ReadingNumber>& reading_numbers() {
  using M = MaterialReading;
  static const std::vector<ReadingNumber> numbers{
      {"mu", "shear modulus mu", "Pa", &M::mu},
      {"lambda", "lambda", "Pa", &M::lambda},
      {"young", "Young's modulus E", "Pa", &M::young},
      {"poisson", "Poisson's ratio nu", "", &M::poisson},
      {"yield_stress", "yield stress", "Pa", &M::yield_stress},
      {"friction_angle", "friction angle", "rad", &M::friction_angle},
      {"cohesion", "cohesion", "Pa", &M::cohesion},
      {"viscosity", "viscosity", "Pa s", &M::viscosity}};
  return numbers;
}

}  // namespace uniphy
