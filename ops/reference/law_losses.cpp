#include "ops/reference/law_losses.hpp"

#include "ops/base/torch.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/reference/isotropic_tensors.hpp"
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
  const auto output = [&c](kernels::CapOutput k) { return c.select(2, k); };
  const Tensor slope = sinh_of(output(kernels::kCapSlope));
  const Tensor c1 = output(kernels::kCap) + slope * trace * inv_e;
  const Tensor cap_q = e * c1;
  const Tensor cap_t = e * (output(kernels::kTraceCap) -
                            answers.caps_rest.select(2, kernels::kTraceCap).clamp_max(0.0));
  const Tensor mean_square =
      torch::exp(2.0 * (deviator + trace.unsqueeze(2) / 3.0)).mean(2);  // b̄, where nothing clamps
  const Tensor flow_time = scales.select(1, 3).unsqueeze(1);
  const Tensor viscosity = sinh_of(output(kernels::kCapViscosity));
  const Tensor factor = mean_square / flow_time;
  const Tensor share = 1.0 / (1.0 + relative_viscosity(viscosity, factor));
  const Tensor norm = deviator.norm(2, 2);
  const Tensor norm_kind = column(batch, Column::norm_yields);
  const Tensor norm_decrease = column(batch, Column::norm_decrease);
  const Tensor trace_decrease = column(batch, Column::trace_decrease);
  const Tensor projected_trace = column(batch, Column::projected_trace);
  const Tensor trace_cut = column(batch, Column::trace_yields) > 0.5;
  // Where the law does not cut, any cap beyond the strain is right, the less so the smaller the
  // share; where it cuts to nothing, any cap at or below zero is.
  const Tensor missed = torch::relu(norm - cap_q) * share.detach().clamp_min(kLeastShare);
  const Tensor to_zero = norm_kind > 1.5, reached = torch::where(to_zero, cap_q.relu(), cap_q);
  const Tensor over = norm - reached, power = flow_exponent(output(kernels::kFlowExponent));
  const Tensor exponent = torch::where(c1 > 0, power, torch::ones_like(c1));
  const Tensor kept = e * kept_excess(over * inv_e, viscosity, factor, exponent);
  const auto of_norm = [&](const Tensor& y) {
    return torch::where(to_zero, reached + y,
                        torch::where(norm_kind > 0.5, over - y - norm_decrease, missed));
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
  return {(square(of_norm(kept)) + others) / size2,
          (square(of_norm(torch::zeros_like(kept))) + others) / size2, share};
}

/// [N, m], in the frame of the projected F.
Tensor stress_errors(const Tensor& batch, const Tensor& scales, const Tensor& s, const Tensor& e,
                     const IsotropicAnswers& answers, double floor) {
  const Tensor inv_e = 1.0 / e;
  const auto output = [&answers](kernels::StressOutput k) { return answers.moduli.select(2, k); };
  const auto exponent = [&](kernels::StressOutput k) {
    return bounded(output(k), kernels::kExponentLimit);
  };
  const Tensor deviator = columns(batch, Column::projected_deviator, 3);
  const Tensor trace = column(batch, Column::projected_trace);
  const Rate rate = rate_of(batch);
  const Tensor rate_square = square(rate.deviatoric).sum(2) + 2.0 * square(rate.off).sum(2);
  const Tensor kappa = bounded(output(kernels::kRateScale), kernels::kRateScaleLimit).exp();
  const Tensor nu = bounded(output(kernels::kRateExponent), kernels::kRateExponentLimit);
  const Tensor b = sinh_of(output(kernels::kViscosity));
  const Tensor viscosity =
      b + sinh_of(output(kernels::kRateViscosity)) * (1.0 + square(kappa) * rate_square).pow(nu);
  const Tensor volume =
      strain_measure(trace, exponent(kernels::kVolumeGamma), exponent(kernels::kVolumeDelta));
  const Tensor pressure = sinh_of(output(kernels::kBulk)) * volume * inv_e +
                          output(kernels::kPressure) -
                          answers.moduli_rest.select(2, kernels::kPressure) +
                          b * (1.0 - output(kernels::kBulkRateShare)) * rate.trace / 3.0;
  const Tensor omega = exponent(kernels::kIsochoricShare).unsqueeze(2);
  const Tensor x = deviator + (1.0 - omega) * trace.unsqueeze(2) / 3.0;
  const auto term = [&](kernels::StressOutput a, kernels::StressOutput n) {
    const Tensor half = 0.5 * exponent(n).unsqueeze(2);
    return strain_measure(x, half, half) * (sinh_of(output(a)) * inv_e).unsqueeze(2);
  };
  const Tensor M = term(kernels::kShear, kernels::kShearExponent) +
                   term(kernels::kSecondShear, kernels::kSecondExponent);
  const Tensor tau_diagonal = pressure.unsqueeze(2) + M - omega * M.mean(2, true) +
                              viscosity.unsqueeze(2) * rate.deviatoric;
  const Tensor tau = columns(batch, Column::stress, 6), s2 = s.unsqueeze(2);
  const Tensor error2 =
      square(s2 * tau_diagonal - tau.narrow(2, 0, 3)).sum(2) +
      2.0 * square(s2 * viscosity.unsqueeze(2) * rate.off - tau.narrow(2, 3, 3)).sum(2);
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
