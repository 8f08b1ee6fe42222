#include "ops/reference/law_losses.hpp"

#include <torch/torch.h>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/reference/learned_law.hpp"

namespace uniphy::ops::reference {
namespace {

using Column = kernels::SampleColumns;
using torch::square;
using torch::Tensor;

/// [N, m, columns]
Tensor gather(const IsotropicBatch& batch) {
  return batch.columns.index_select(0, batch.rows.reshape({-1}))
      .view({batch.rows.size(0), batch.rows.size(1), Column::count});
}
Tensor columns(const Tensor& batch, int first, int count) { return batch.narrow(2, first, count); }
Tensor column(const Tensor& batch, int index) { return batch.select(2, index); }

Tensor sinh_of(const Tensor& x) {
  return torch::sinh(x.clamp(-kernels::kSinhLimit, kernels::kSinhLimit));
}
Tensor exponent_of(const Tensor& x) {
  return x.clamp(-kernels::kExponentLimit, kernels::kExponentLimit);
}
Tensor argument_of(const Tensor& x) {
  return x.clamp(-kernels::kArgumentLimit, kernels::kArgumentLimit);
}

/// x exp(δx) sinh(γx)/(γx), the measures of ops/kernels/spectral/strain_measure.hpp.
Tensor strain_measure(const Tensor& x, const Tensor& gamma, const Tensor& delta) {
  const Tensor y = argument_of(gamma * x), small = y.abs() < 1e-2;
  const Tensor far = torch::where(small, torch::ones_like(y), y), y2 = y * y;
  const Tensor ratio =
      torch::where(small, 1.0 + y2 / 6.0 * (1.0 + y2 / 20.0), torch::sinh(far) / far);
  return x * torch::exp(argument_of(delta * x)) * ratio;
}

/// The least weight of a cap that is missed where the law does not cut.
constexpr double kLeastShare = 0.05;

/// Invariants of w [N, m, 3], as in ops/kernels/learned/isotropic_law.hpp.
struct Invariants {
  Tensor q, cubic;
};
Invariants invariants(const Tensor& w) {
  const double d = kernels::kInvariantSmoothing;
  const Tensor root2 = (w * w).sum(2) + d * d;
  return {torch::sqrt(root2) - d, (w * w * w).sum(2) / root2};
}

/// The rate of deformation: its diagonal, the deviator of that, and what is off the diagonal.
struct Rate {
  Tensor trace, deviatoric, off;
};
Rate rate_of(const Tensor& batch) {
  const Tensor rate = columns(batch, Column::rate, 6), diagonal = rate.narrow(2, 0, 3);
  const Tensor trace = diagonal.sum(2);
  return {trace, diagonal - trace.unsqueeze(2) / 3.0, rate.narrow(2, 3, 3)};
}

struct ProjectionErrors {
  Tensor error, whole, share;  // [N, m]
};
ProjectionErrors projection_errors(const Tensor& batch, const Tensor& scales, const Tensor& e,
                                   const IsotropicAnswers& answers, double floor) {
  const Tensor deviator = columns(batch, Column::deviator, 3), trace = column(batch, Column::trace);
  const Tensor &c = answers.caps, inv_e = 1.0 / e;
  const Tensor slope = sinh_of(c.select(2, 2));
  const Tensor c1 = c.select(2, 0) + slope * trace * inv_e;
  const Tensor cap_q = e * c1;
  const Tensor cap_t = e * (c.select(2, 1) - answers.caps_rest.select(2, 1).clamp_max(0.0));
  const Tensor mean_square =
      torch::exp(2.0 * (deviator + trace.unsqueeze(2) / 3.0)).mean(2);  // b̄, where nothing clamps
  const Tensor share =
      1.0 / (1.0 + (sinh_of(c.select(2, 3)) / mean_square).clamp_min(kernels::kLeastViscosity));
  const Tensor norm = deviator.norm(2, 2);
  const Tensor norm_kind = column(batch, Column::norm_yields);
  const Tensor norm_decrease = column(batch, Column::norm_decrease);
  const Tensor trace_decrease = column(batch, Column::trace_decrease);
  const Tensor projected_trace = column(batch, Column::projected_trace);
  const Tensor trace_cut = column(batch, Column::trace_yields) > 0.5;
  // Where the law does not cut, any cap beyond the strain is right, the less so the smaller the
  // share; where it cuts to nothing, any cap at or below zero is.
  const Tensor missed = torch::relu(norm - cap_q) * share.detach().clamp_min(kLeastShare);
  const auto of_norm = [&](const Tensor& r) {
    return torch::where(norm_kind > 1.5, norm - r * (norm - torch::relu(cap_q)),
                        torch::where(norm_kind > 0.5, r * (norm - cap_q) - norm_decrease, missed));
  };
  // Whatever the share, a cap is no higher than what a sample that yields comes down to.
  const Tensor above =
      torch::where((norm_kind > 0.5) & (norm_kind < 1.5), torch::relu(cap_q - norm + norm_decrease),
                   torch::zeros_like(norm));
  // A fluid's cap is to lie below kFluidCap, with some room.
  const Tensor fluid = (norm_kind > 1.5) & ~trace_cut;
  const Tensor of_fluid = torch::where(fluid, 0.1 * norm * torch::relu(c1 - 2 * kernels::kFluidCap),
                                       torch::zeros_like(norm));
  const Tensor least_cap = torch::where(fluid, trace + torch::relu(trace), trace);
  const Tensor of_trace =
      torch::where(trace_cut, cap_t - projected_trace, torch::relu(least_cap - cap_t));
  const Tensor decrease2 = square(norm_decrease) + square(trace_decrease) / 3.0;
  const Tensor strain_rms = scales.select(1, 1).unsqueeze(1);
  const Tensor decrease_rms = scales.select(1, 2).unsqueeze(1);
  const Tensor unit = torch::where(decrease_rms > 0, decrease_rms, strain_rms);
  const Tensor others = square(above) + square(of_fluid) + square(of_trace) / 3.0;
  const Tensor size2 = decrease2 + square(floor * unit) + 1e-20;
  return {(square(of_norm(share)) + others) / size2,
          (square(of_norm(torch::ones_like(share))) + others) / size2, share};
}

/// [N, m], in the frame of the projected F.
Tensor stress_errors(const Tensor& batch, const Tensor& scales, const Tensor& s, const Tensor& e,
                     const IsotropicAnswers& answers, double floor) {
  const Tensor &a = answers.moduli, inv_e = 1.0 / e;
  const Tensor deviator = columns(batch, Column::projected_deviator, 3);
  const Tensor trace = column(batch, Column::projected_trace);
  const Tensor w = deviator * inv_e.unsqueeze(2);
  const Rate rate = rate_of(batch);
  const Tensor b = sinh_of(a.select(2, 4));
  const Tensor volume =
      strain_measure(trace, exponent_of(a.select(2, 6)), exponent_of(a.select(2, 7)));
  const Tensor pressure = sinh_of(a.select(2, 0)) * volume * inv_e + a.select(2, 1) -
                          answers.moduli_rest.select(2, 1) + b * rate.trace / 3.0;
  const Tensor half = 0.5 * exponent_of(a.narrow(2, 5, 1));
  const Tensor principal = strain_measure(deviator + trace.unsqueeze(2) / 3.0, half, half) *
                           (sinh_of(a.select(2, 2)) * inv_e).unsqueeze(2);
  const Tensor w2 = square(w);
  const Tensor second = (w2 - w2.mean(2, true)) / (1.0 + invariants(w).q).unsqueeze(2);
  const Tensor tau_diagonal = pressure.unsqueeze(2) + principal + a.narrow(2, 3, 1) * second +
                              b.unsqueeze(2) * rate.deviatoric;
  const Tensor tau = columns(batch, Column::stress, 6), s2 = s.unsqueeze(2);
  const Tensor error2 = square(s2 * tau_diagonal - tau.narrow(2, 0, 3)).sum(2) +
                        2.0 * square(s2 * b.unsqueeze(2) * rate.off - tau.narrow(2, 3, 3)).sum(2);
  const Tensor tau2 = square(tau.narrow(2, 0, 3)).sum(2) + 2.0 * square(tau.narrow(2, 3, 3)).sum(2);
  return error2 / (tau2 + square(floor * scales.select(1, 0)).unsqueeze(1) + 1e-20);
}

}  // namespace

IsotropicFeatures isotropic_features(const IsotropicBatch& table, const Tensor& z) {
  const Tensor batch = gather(table), inv_e = 1.0 / strain_scale(z).unsqueeze(1);
  const auto scaled = [&](int first) { return columns(batch, first, 3) * inv_e.unsqueeze(2); };
  const Invariants trial = invariants(scaled(Column::deviator));
  const Tensor w = scaled(Column::projected_deviator);
  const Invariants strain = invariants(w);
  const Rate rate = rate_of(batch);
  const double d = kernels::kInvariantSmoothing;
  const Tensor rate_norm =
      torch::sqrt(square(rate.deviatoric).sum(2) + 2.0 * square(rate.off).sum(2) + d * d) - d;
  const Tensor x = (w * rate.deviatoric).sum(2) / (1.0 + rate_norm * strain.q);
  return {torch::stack({column(batch, Column::trace) * inv_e, trial.q, trial.cubic}, 2),
          torch::stack({column(batch, Column::projected_trace) * inv_e, strain.q, strain.cubic,
                        rate.trace, rate_norm, x},
                       2)};
}

LawLosses law_losses(const IsotropicBatch& table, const Tensor& scales, const Tensor& z,
                     const IsotropicAnswers& answers, const ErrorMeasure& measure) {
  const Tensor batch = gather(table), e = strain_scale(z).unsqueeze(1);
  const ProjectionErrors p = projection_errors(batch, scales, e, answers, measure.floor);
  const Tensor stress =
      stress_errors(batch, scales, stress_scale(z).unsqueeze(1), e, answers, measure.floor);
  const auto loss = [&](const Tensor& error) {
    return torch::log1p(error / measure.delta).mean(1);
  };
  // In the order of kernels::IsotropicMean.
  return {torch::stack({loss(stress), loss(p.error), loss(p.whole), p.share.mean(1)}, 1),
          torch::stack({stress.mean(1), p.error.mean(1)}, 1).detach()};
}

}  // namespace uniphy::ops::reference
