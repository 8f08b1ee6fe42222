#include "uniphy/training/objective.hpp"

#include <cmath>

namespace uniphy {
namespace {

using torch::square;
using torch::Tensor;

/// Weight of p̃². A power other than 1 and a cap that is a little too low look alike on samples, and
/// a law that returns the whole way has none: p̃ = 0.1 is to be worth an error of 0.3 %.
constexpr double kPowerPull = 1;

}  // namespace

Objective::Objective(const LawColumns& columns, const ops::ErrorMeasure& measure,
                     const ObjectiveOps& ops)
    : form_(columns.form), measure_(measure), ops_(ops), columns_(columns.values) {
  scales_ = torch::empty({columns.trajectories(), 4}, torch::kFloat32);
  float* at = scales_.data_ptr<float>();
  for (const TrajectoryScale& s : columns.scales) {
    *at++ = float(s.stress);
    *at++ = float(s.strain);
    *at++ = float(s.decrease);
    *at++ = float(s.flow_time);
  }
}

LawErrors Objective::errors(const models::LearnedLaw& law, const Tensor& z, const Tensor& rows,
                            const Tensor& scale_rows) const {
  const Tensor scale = scales_.index_select(0, scale_rows);
  return form_ == kernels::LawForm::isotropic ? isotropic(law, z, rows, scale)
                                              : published(law, z, rows, scale);
}

LawErrors Objective::isotropic(const models::LearnedLaw& law, const Tensor& z, const Tensor& rows,
                               const Tensor& scale) const {
  const std::int64_t n = z.size(0);
  const ops::IsotropicBatch batch{columns_, rows};
  const auto answer = [&](const ops::FlatLayers& layers, const Tensor& features) {
    return ops_.mlp(features, z, layers, law->activation());
  };
  const ops::FlatLayers &caps = law->networks().projection, &moduli = law->networks().stress;
  ops::IsotropicFeatures features;
  if (law->state_caps() || law->state_moduli()) features = ops_.isotropic_features(batch, z);
  ops::IsotropicAnswers answers;
  answers.caps_rest = answer(caps, torch::zeros({n, 1, 3}));
  answers.caps = law->state_caps() ? answer(caps, features.projection) : answers.caps_rest;
  answers.moduli_rest = answer(moduli, torch::zeros({n, 1, 6}));
  answers.moduli = law->state_moduli() ? answer(moduli, features.stress) : answers.moduli_rest;
  const ops::LawLosses e = ops_.law_losses(batch, scale, z, answers, measure_);
  const auto loss = [&e](kernels::IsotropicMean k) { return e.losses.select(1, k); };
  const Tensor power = square(answers.caps.select(2, kernels::kFlowExponent)).mean(1);
  return {loss(kernels::kStressLoss),
          loss(kernels::kProjectionLoss),
          loss(kernels::kWholeLoss),
          loss(kernels::kShare),
          power,
          e.errors.select(1, 0),
          e.errors.select(1, 1)};
}

LawErrors Objective::published(const models::LearnedLaw& law, const Tensor& z, const Tensor& rows,
                               const Tensor& scale) const {
  using Column = PublishedColumns;
  const Tensor batch = columns_.index_select(0, rows.reshape({-1}))
                           .view({rows.size(0), rows.size(1), columns_.size(1)});
  const auto columns = [&batch](int first, int count) { return batch.narrow(2, first, count); };
  const Tensor s = kernels::kStressScale * torch::exp(kernels::kStressRate * z.select(1, 0));
  const ops::LearnedNetworks& networks = law->networks();
  const Tensor delta =
      ops_.mlp(columns(Column::projection_in, 30), z, networks.projection, networks.activation);
  const Tensor true_delta = columns(Column::delta, 9);
  const Tensor strain_rms = scale.select(1, 1).unsqueeze(1);
  const Tensor decrease_rms = scale.select(1, 2).unsqueeze(1);
  const Tensor unit = torch::where(decrease_rms > 0, decrease_rms, strain_rms);
  const Tensor projection = square(delta - true_delta).sum(2) /
                            (square(true_delta).sum(2) + square(measure_.floor * unit) + 1e-20);
  const Tensor s1 =
      ops_.mlp(columns(Column::stress_in, 25), z, networks.stress, networks.activation);
  const Tensor matrix = s1.view({s1.size(0), s1.size(1), 3, 3});
  const Tensor symmetric = 0.5 * (matrix + matrix.transpose(2, 3)).reshape(s1.sizes());
  const Tensor tau = columns(Column::stress, 9);
  const Tensor stress =
      square(s.unsqueeze(1).unsqueeze(2) * symmetric - tau).sum(2) /
      (square(tau).sum(2) + square(measure_.floor * scale.select(1, 0)).unsqueeze(1) + 1e-20);
  const auto loss = [this](const Tensor& error) {
    return torch::log1p(error / measure_.delta).mean(1);
  };
  return {loss(stress),
          loss(projection),
          {},
          {},
          {},
          stress.detach().mean(1),
          projection.detach().mean(1)};
}

Tensor Objective::loss(const LawErrors& e, ReturnStage stage) {
  if (!e.share.defined()) return e.stress_loss + e.projection_loss;
  const Tensor others = e.stress_loss + kPowerPull * e.power;
  if (stage == ReturnStage::actual) return others + e.projection_loss;
  const Tensor whole = e.whole_loss + (1.0 - e.share).abs();
  return others + (stage == ReturnStage::whole ? whole : torch::minimum(e.projection_loss, whole));
}

double median_root(const Tensor& errors) { return errors.sqrt().median().item<double>(); }

}  // namespace uniphy
