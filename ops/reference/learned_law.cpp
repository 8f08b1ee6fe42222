#include "ops/reference/learned_law.hpp"

#include <limits>

#include "ops/base/torch.hpp"
#include "ops/kernels/learned/published_scales.hpp"
#include "ops/reference/isotropic_tensors.hpp"
#include "ops/reference/mlp.hpp"

namespace uniphy::ops::reference {

using kernels::LawForm;
using torch::Tensor;

namespace {

/// features [P, n] and z [Z] or [P, Z] → [P, out].
Tensor network(const LearnedNetworks& law, const FlatLayers& layers, const Tensor& features,
               const Tensor& z) {
  if (z.dim() == 1)
    return reference::mlp(features.unsqueeze(0), z.unsqueeze(0), layers, law.activation).squeeze(0);
  return reference::mlp(features.unsqueeze(1), z, layers, law.activation).squeeze(1);
}

/// The answer at F = I, C = 0, where every isotropic feature is 0: [1 or P, out].
Tensor at_rest(const LearnedNetworks& law, const FlatLayers& layers, const Tensor& z) {
  const std::int64_t particles = z.dim() == 2 ? z.size(0) : 1;
  const std::int64_t features = layers.widths.front() - z.size(-1);
  return network(law, layers, torch::zeros({particles, features}, z.options()), z);
}

Tensor trace_of(const Tensor& m) { return torch::diagonal(m, 0, 1, 2).sum(-1); }  // [P]
Tensor identity(const Tensor& like) { return torch::eye(3, like.options()); }
Tensor at_matrix(const Tensor& s) { return s.unsqueeze(-1).unsqueeze(-1); }  // [P] → [P, 1, 1]
Tensor contract(const Tensor& a, const Tensor& b) { return (a * b).sum({1, 2}); }
Tensor deviator(const Tensor& m) { return m - at_matrix(trace_of(m) / 3) * identity(m); }
Tensor symmetric(const Tensor& m) { return 0.5 * (m + m.mT()); }

/// (exp(n H) − I)/n, n [P].
Tensor seth_hill_measure(const Tensor& H, const Tensor& n) {
  const Tensor small = n.abs() < 1e-2, far = torch::where(small, torch::ones_like(n), n);
  const Tensor X = at_matrix(n) * H;
  Tensor series = identity(H) + X / 9;
  for (int k = 8; k >= 2; --k) series = identity(H) + X.matmul(series) / k;
  const Tensor whole = (symmetric_exp(at_matrix(far) * H) - identity(H)) / at_matrix(far);
  return torch::where(at_matrix(small), H.matmul(series), whole);
}

/// Smooth invariants of w = ε̂/e.
struct Invariants {
  Tensor W;      ///< dev H / e, [P, 3, 3]
  Tensor t;      ///< tr H / e, [P]
  Tensor q;      ///< sqrt(‖W‖² + d²) − d
  Tensor cubic;  ///< tr W³/(‖W‖² + d²)
};
Invariants invariants(const Tensor& H, const Tensor& e) {
  constexpr double d = kernels::kInvariantSmoothing;
  Invariants v;
  v.W = deviator(H) / at_matrix(e);
  v.t = trace_of(H) / e;
  const Tensor root2 = contract(v.W, v.W) + d * d;
  v.q = root2.sqrt() - d;
  v.cubic = contract(v.W.matmul(v.W), v.W) / root2;
  return v;
}

Tensor isotropic_project(const LearnedNetworks& law, const Tensor& F, const Tensor& z, double dt) {
  const Tensor H = hencky_tensor(F);
  const Tensor e = strain_scale(z);
  const IsotropicCaps caps = isotropic_caps(law, H, z, dt);
  const Tensor least_q = caps.c1.clamp_min(0), cap_q = e * least_q, cap_t = e * caps.c2;
  const Tensor H_dev = deviator(H), t = trace_of(H), norm2 = contract(H_dev, H_dev);
  const Tensor one = torch::ones_like(norm2);
  const double tiny = H.scalar_type() == torch::kFloat64
                          ? std::numeric_limits<double>::min()
                          : double(std::numeric_limits<float>::min());
  const Tensor deviates = norm2 > tiny;
  const Tensor norm = torch::where(deviates, norm2, one).sqrt();
  // c₁ ≤ 0 yields even at ‖ε̂‖ = 0, where only the derivative can tell.
  const Tensor over = (deviates & (norm > cap_q)) | (caps.c1 <= 0), over_t = t > cap_t;
  const Tensor kept = kept_excess(norm / e - least_q, caps.viscosity, caps.factor, caps.exponent);
  const Tensor linear = relative_viscosity(caps.viscosity, caps.factor);
  const Tensor cut = torch::where(deviates, e * (least_q + kept) / norm, linear / (1 + linear));
  const Tensor scale = torch::where(over, cut, one);
  const Tensor trace_proj = torch::where(over_t, cap_t, t);
  const Tensor M = at_matrix(scale) * H_dev + at_matrix(trace_proj / 3) * identity(F);
  const Tensor yielded = symmetric_exp(M).matmul(polar_rotation(F, signed_svd(F.detach())));
  const Tensor projected = torch::where(at_matrix(over | over_t), yielded, F);
  const Tensor fluid = (caps.c1 < kernels::kFluidCap) & ~over_t;
  return torch::where(at_matrix(fluid), at_matrix((t / 3).exp()) * identity(F), projected);
}

constexpr double kPublishedFloor = 1e-6;

Tensor published_project(const LearnedNetworks& law, const Tensor& F, const Tensor& z) {
  const SignedSvd s = signed_svd(F);
  const Tensor e = strain_scale(z), I = identity(F);
  const Tensor features =
      torch::cat({(F - I).flatten(1), (s.U - I).flatten(1), s.sigma - 1, (s.V.mT() - I).flatten(1)},
                 1) /
      e.unsqueeze(-1);
  const Tensor delta = network(law, law.projection, features, z).reshape(F.sizes());
  return F + kernels::kDeltaOverStrain * at_matrix(e) * delta;
}

Tensor published_stress(const LearnedNetworks& law, const Tensor& F, const Tensor& C,
                        const Tensor& z) {
  const SignedSvd s = signed_svd(F);
  const Tensor R = polar_rotation(F, s);
  // Not torch's determinant, whose gradient divides by J.
  const Tensor J = (torch::linalg_cross(F.select(1, 0), F.select(1, 1)) * F.select(1, 2)).sum(1);
  const Tensor F_max = F.select(1, 0).select(1, 0).clamp_min(kPublishedFloor);
  const Tensor rate = R.mT().matmul(C).matmul(R) * kernels::kTimeScale;
  const Tensor of_strain =
      torch::cat({s.sigma - 1, (F.mT().matmul(F) - identity(F)).flatten(1), J.unsqueeze(1) - 1,
                  J.clamp_min(kPublishedFloor).log().unsqueeze(1), F_max.unsqueeze(1) - 1,
                  F_max.log().unsqueeze(1)},
                 1);
  const Tensor features =
      torch::cat({of_strain / strain_scale(z).unsqueeze(-1), rate.flatten(1)}, 1);
  const Tensor S = network(law, law.stress, features, z).reshape(F.sizes());
  return at_matrix(stress_scale(z)) * R.matmul(symmetric(S)).matmul(R.mT());
}

}  // namespace

Tensor stress_scale(const Tensor& z) {
  if (z.size(-1) < 1) return torch::full({}, kernels::kStressScale, z.options());
  return kernels::kStressScale * torch::exp(kernels::kStressRate * z.select(-1, 0));
}

Tensor strain_scale(const Tensor& z) {
  if (z.size(-1) < 2) return torch::full({}, kernels::kStrainScale, z.options());
  return kernels::kStrainScale * torch::exp(kernels::kStrainRate * z.select(-1, 1));
}

IsotropicCaps isotropic_caps(const LearnedNetworks& law, const Tensor& H, const Tensor& z,
                             double dt) {
  const Invariants v = invariants(H, strain_scale(z));
  const Tensor c = network(law, law.projection, torch::stack({v.t, v.q, v.cubic}, 1), z);
  const Tensor rest = at_rest(law, law.projection, z).select(1, kernels::kTraceCap).clamp_max(0);
  const Tensor slope = sinh_of(c.select(1, kernels::kCapSlope));
  const Tensor mean_square = trace_of(symmetric_exp(2 * H)) / 3;
  IsotropicCaps caps;
  caps.c1 = c.select(1, kernels::kCap) + slope * v.t;
  caps.c2 = c.select(1, kernels::kTraceCap) - rest;
  caps.viscosity = sinh_of(c.select(1, kernels::kCapViscosity));
  caps.factor = mean_square * (dt / kernels::kFlowStep);
  const Tensor exponent = flow_exponent(c.select(1, kernels::kFlowExponent));
  caps.exponent = torch::where(caps.c1 > 0, exponent, torch::ones_like(exponent));
  return caps;
}

Tensor isotropic_stress(const LearnedNetworks& law, const Tensor& H, const Tensor& C,
                        const Tensor& z) {
  constexpr double d = kernels::kInvariantSmoothing;
  const Invariants v = invariants(H, strain_scale(z));
  const Tensor D = symmetric(C) * kernels::kTimeScale, D_dev = deviator(D), D_trace = trace_of(D);
  const Tensor rate_square = contract(D_dev, D_dev), n = (rate_square + d * d).sqrt() - d;
  const Tensor x = contract(v.W, D_dev) / (1 + n * v.q);
  const Tensor f = network(law, law.stress, torch::stack({v.t, v.q, v.cubic, D_trace, n, x}, 1), z);
  const Tensor rest = at_rest(law, law.stress, z).select(1, kernels::kPressure);
  const auto output = [&f](kernels::StressOutput k) { return f.select(1, k); };
  const auto exponent = [&](kernels::StressOutput k) {
    return bounded(output(k), kernels::kExponentLimit);
  };
  const Tensor e = strain_scale(z), t = trace_of(H), b = sinh_of(output(kernels::kViscosity));
  const Tensor volume =
      strain_measure(t, exponent(kernels::kVolumeGamma), exponent(kernels::kVolumeDelta));
  const Tensor pressure = sinh_of(output(kernels::kBulk)) * volume / e +
                          (output(kernels::kPressure) - rest) +
                          b * (1 - output(kernels::kBulkRateShare)) * D_trace / 3;
  const Tensor omega = exponent(kernels::kIsochoricShare);
  const Tensor X = H - at_matrix(omega * t / 3) * identity(H);
  const auto term = [&](kernels::StressOutput a, kernels::StressOutput power) {
    return at_matrix(sinh_of(output(a)) / e) * seth_hill_measure(X, exponent(power));
  };
  const Tensor M = term(kernels::kShear, kernels::kShearExponent) +
                   term(kernels::kSecondShear, kernels::kSecondExponent);
  const Tensor kappa = bounded(output(kernels::kRateScale), kernels::kRateScaleLimit).exp();
  const Tensor nu = bounded(output(kernels::kRateExponent), kernels::kRateExponentLimit);
  const Tensor viscosity =
      b + sinh_of(output(kernels::kRateViscosity)) * (1 + kappa * kappa * rate_square).pow(nu);
  const Tensor in_units_of_s = at_matrix(pressure - omega * trace_of(M) / 3) * identity(H) + M +
                               at_matrix(viscosity) * D_dev;
  return at_matrix(stress_scale(z)) * in_units_of_s;
}

Tensor learned_project(const LearnedNetworks& law, const Tensor& F, const Tensor& z, double dt) {
  return law.form == LawForm::isotropic ? isotropic_project(law, F, z, dt)
                                        : published_project(law, F, z);
}

Tensor learned_stress(const LearnedNetworks& law, const Tensor& F_proj, const Tensor& C,
                      const Tensor& z) {
  return law.form == LawForm::isotropic ? isotropic_stress(law, hencky_tensor(F_proj), C, z)
                                        : published_stress(law, F_proj, C, z);
}

}  // namespace uniphy::ops::reference
