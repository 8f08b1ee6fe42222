#include "uniphy/training/objective.hpp"

#include <cmath>

namespace uniphy {
namespace {

using torch::square;
using torch::Tensor;

/// The network on [N, m, features] with z [N, Z] beside every sample → [N, m, out].
Tensor network(const std::vector<ops::LinearLayer>& layers, const Networks& networks,
               const Tensor& features, const Tensor& z) {
  const std::int64_t n = features.size(0), m = features.size(1);
  const Tensor in = torch::cat({features, z.unsqueeze(1).expand({n, m, z.size(1)})}, 2);
  return ops::mlp(in.reshape({n * m, -1}), layers, networks.options.activation).view({n, m, -1});
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

/// x exp(δx) sinh(γx)/(γx), the measures of ops/kernels/strain_measure.hpp.
Tensor strain_measure(const Tensor& x, const Tensor& gamma, const Tensor& delta) {
  const Tensor y = argument_of(gamma * x), small = y.abs() < 0.1;
  const Tensor far = torch::where(small, torch::ones_like(y), y), y2 = y * y;
  const Tensor ratio =
      torch::where(small, 1.0 + y2 / 6.0 * (1.0 + y2 / 20.0), torch::sinh(far) / far);
  return x * torch::exp(argument_of(delta * x)) * ratio;
}

/// The least weight of a cap that is missed where the law does not cut.
constexpr double kLeastShare = 0.05;
/// Pulls the share of a trajectory that returns the whole way to 1.
constexpr double kReturnWhole = 1;

/// Invariants of w [N, m, 3], as in ops/kernels/isotropic_law.hpp.
struct Invariants {
  Tensor q, cubic;
};
Invariants invariants(const Tensor& w) {
  const double d = kernels::kInvariantSmoothing;
  const Tensor root2 = (w * w).sum(2) + d * d;
  return {torch::sqrt(root2) - d, (w * w * w).sum(2) / root2};
}

}  // namespace

Objective::Objective(const LawColumns& columns, kernels::LawForm form, double floor)
    : form_(form), floor_(floor) {
  const std::int64_t samples = std::int64_t(columns.values.size()) / columns.columns;
  columns_ = torch::empty({samples, columns.columns}, torch::kFloat32);
  std::copy(columns.values.begin(), columns.values.end(), columns_.data_ptr<float>());
  scales_ = torch::empty({std::int64_t(columns.scales.size()), 3}, torch::kFloat32);
  float* at = scales_.data_ptr<float>();
  for (const TrajectoryScale& s : columns.scales) {
    *at++ = float(s.stress);
    *at++ = float(s.strain);
    *at++ = float(s.decrease);
  }
}

LawErrors Objective::errors(const Networks& networks, const Tensor& z, const Tensor& rows,
                            const Tensor& scale_rows) const {
  const Tensor batch = columns_.index_select(0, rows.reshape({-1}))
                           .view({rows.size(0), rows.size(1), columns_.size(1)});
  const Tensor scale = scales_.index_select(0, scale_rows);
  return form_ == kernels::LawForm::isotropic ? isotropic(networks, z, batch, scale)
                                              : seed(networks, z, batch, scale);
}

LawErrors Objective::isotropic(const Networks& networks, const Tensor& z, const Tensor& batch,
                               const Tensor& scale) const {
  using Column = IsotropicColumns;
  const Tensor s = kernels::kStressScale * torch::exp(kernels::kStressRate * z.select(1, 0));
  const Tensor e = kernels::kStrainScale * torch::exp(kernels::kStrainRate * z.select(1, 1));
  const Tensor e1 = e.unsqueeze(1), inv_e = 1.0 / e1;
  const std::int64_t n = z.size(0);

  // The projection: caps on ‖ε̂‖ and tr ε.
  const Tensor deviator = columns(batch, Column::deviator, 3), trace = column(batch, Column::trace);
  const Invariants trial = invariants(deviator * inv_e.unsqueeze(2));
  const Tensor c_rest = network(networks.projection, networks, torch::zeros({n, 1, 3}), z);
  const Tensor c = networks.options.state_caps
                       ? network(networks.projection, networks,
                                 torch::stack({trace * inv_e, trial.q, trial.cubic}, 2), z)
                       : c_rest;
  const Tensor slope = sinh_of(c.select(2, 2));
  const Tensor c1 = c.select(2, 0) + slope * trace * inv_e;
  const Tensor cap_q = e1 * c1;
  const Tensor cap_t = e1 * (c.select(2, 1) - c_rest.select(2, 1).clamp_max(0.0));
  const Tensor mean_square =
      torch::exp(2.0 * (deviator + trace.unsqueeze(2) / 3.0)).mean(2);  // b̄, where nothing clamps
  const Tensor share = 1.0 / (1.0 + torch::exp(-c.select(2, 3).clamp(-40, 40)) / mean_square);
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
  // Whatever the share, a cap is no higher than what a sample that yields comes down to. Without
  // this a share near 0 would hide a cap that is far too high.
  const Tensor above =
      torch::where((norm_kind > 0.5) & (norm_kind < 1.5), torch::relu(cap_q - norm + norm_decrease),
                   torch::zeros_like(norm));
  // A fluid's cap is to lie below kFluidCap, with some room.
  const Tensor of_fluid = torch::where((norm_kind > 1.5) & ~trace_cut,
                                       0.1 * norm * torch::relu(c1 - 2 * kernels::kFluidCap), 0.0);
  const Tensor of_trace =
      torch::where(trace_cut, cap_t - projected_trace, torch::relu(trace - cap_t));
  const Tensor decrease2 = square(norm_decrease) + square(trace_decrease) / 3.0;
  const Tensor strain_rms = scale.select(1, 1).unsqueeze(1);
  const Tensor decrease_rms = scale.select(1, 2).unsqueeze(1);
  const Tensor unit = torch::where(decrease_rms > 0, decrease_rms, strain_rms);
  const Tensor others = square(above) + square(of_fluid) + square(of_trace) / 3.0;
  const Tensor size2 = decrease2 + square(floor_ * unit) + 1e-20;
  LawErrors errors;
  errors.projection = (square(of_norm(share)) + others) / size2;
  errors.projection_whole = (square(of_norm(torch::ones_like(share))) + others) / size2;
  errors.share = share;

  // The stress, in the frame of the projected F.
  const Tensor w = columns(batch, Column::projected_deviator, 3) * inv_e.unsqueeze(2);
  const Invariants strain = invariants(w);
  const Tensor volumetric = projected_trace * inv_e;
  const Tensor rate = columns(batch, Column::rate, 6);
  const Tensor diagonal = rate.narrow(2, 0, 3), off = rate.narrow(2, 3, 3);
  const Tensor rate_trace = diagonal.sum(2);
  const Tensor deviatoric = diagonal - rate_trace.unsqueeze(2) / 3.0;
  const double d = kernels::kInvariantSmoothing;
  const Tensor rate_norm =
      torch::sqrt(square(deviatoric).sum(2) + 2.0 * square(off).sum(2) + d * d) - d;
  const Tensor x = (w * deviatoric).sum(2) / (1.0 + rate_norm * strain.q);
  const Tensor a_rest = network(networks.stress, networks, torch::zeros({n, 1, 6}), z);
  const Tensor a =
      networks.options.state_moduli
          ? network(networks.stress, networks,
                    torch::stack({volumetric, strain.q, strain.cubic, rate_trace, rate_norm, x}, 2),
                    z)
          : a_rest;
  const Tensor b = sinh_of(a.select(2, 4));
  const Tensor volume =
      strain_measure(projected_trace, exponent_of(a.select(2, 6)), exponent_of(a.select(2, 7)));
  const Tensor pressure = sinh_of(a.select(2, 0)) * volume * inv_e + a.select(2, 1) -
                          a_rest.select(2, 1) + b * rate_trace / 3.0;
  const Tensor half = 0.5 * exponent_of(a.narrow(2, 5, 1));
  const Tensor eps =
      columns(batch, Column::projected_deviator, 3) + projected_trace.unsqueeze(2) / 3.0;
  const Tensor principal =
      strain_measure(eps, half, half) * (sinh_of(a.select(2, 2)) * inv_e).unsqueeze(2);
  const Tensor w2 = square(w);
  const Tensor second = (w2 - w2.mean(2, true)) / (1.0 + strain.q).unsqueeze(2);
  const Tensor tau_diagonal =
      pressure.unsqueeze(2) + principal + a.narrow(2, 3, 1) * second + b.unsqueeze(2) * deviatoric;
  const Tensor tau = columns(batch, Column::stress, 6);
  const Tensor s2 = s.unsqueeze(1).unsqueeze(2);
  const Tensor error2 = square(s2 * tau_diagonal - tau.narrow(2, 0, 3)).sum(2) +
                        2.0 * square(s2 * b.unsqueeze(2) * off - tau.narrow(2, 3, 3)).sum(2);
  const Tensor tau2 = square(tau.narrow(2, 0, 3)).sum(2) + 2.0 * square(tau.narrow(2, 3, 3)).sum(2);
  errors.stress = error2 / (tau2 + square(floor_ * scale.select(1, 0)).unsqueeze(1) + 1e-20);
  return errors;
}

LawErrors Objective::seed(const Networks& networks, const Tensor& z, const Tensor& batch,
                          const Tensor& scale) const {
  using Column = SeedColumns;
  const Tensor s = kernels::kStressScale * torch::exp(kernels::kStressRate * z.select(1, 0));
  const Tensor delta =
      network(networks.projection, networks, columns(batch, Column::projection_in, 30), z);
  const Tensor true_delta = columns(batch, Column::delta, 9);
  const Tensor strain_rms = scale.select(1, 1).unsqueeze(1);
  const Tensor decrease_rms = scale.select(1, 2).unsqueeze(1);
  const Tensor unit = torch::where(decrease_rms > 0, decrease_rms, strain_rms);
  LawErrors errors;
  errors.projection = square(delta - true_delta).sum(2) /
                      (square(true_delta).sum(2) + square(floor_ * unit) + 1e-20);
  const Tensor s1 = network(networks.stress, networks, columns(batch, Column::stress_in, 25), z);
  const Tensor matrix = s1.view({s1.size(0), s1.size(1), 3, 3});
  const Tensor symmetric = 0.5 * (matrix + matrix.transpose(2, 3)).reshape(s1.sizes());
  const Tensor tau = columns(batch, Column::stress, 9);
  errors.stress = square(s.unsqueeze(1).unsqueeze(2) * symmetric - tau).sum(2) /
                  (square(tau).sum(2) + square(floor_ * scale.select(1, 0)).unsqueeze(1) + 1e-20);
  return errors;
}

Tensor Objective::robust_mean(const Tensor& errors, double delta) {
  return torch::log1p(errors / delta).mean();
}

Tensor Objective::projection_loss(const LawErrors& errors, double delta, bool caps_first) {
  const auto loss = [delta](const Tensor& e) { return torch::log1p(e / delta).mean(1); };
  if (!errors.share.defined()) return loss(errors.projection);
  const Tensor whole = loss(errors.projection_whole) + kReturnWhole * (1.0 - errors.share).mean(1);
  return caps_first ? whole : torch::minimum(loss(errors.projection), whole);
}

}  // namespace uniphy
