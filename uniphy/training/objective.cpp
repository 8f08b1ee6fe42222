#include "uniphy/training/objective.hpp"

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/published_scales.hpp"

namespace uniphy {
namespace {

using torch::square;
using torch::Tensor;

/// Weight of p̃². A power other than 1 and a cap that is a little too low look alike on samples, and
/// a law that returns the whole way has none: p̃ = 0.1 is to be worth an error of 0.3 %.
constexpr double kPowerPull = 1;

/// Keeps relative errors finite where nothing is to be found.
constexpr double kLeastSquare = 1e-20;

/// Weight of log(1 + (1 − r)/kNearlyWhole), r the share, where the law is judged as it is: a share
/// of 0.95 and a cap that is a little too low look alike on samples, too, and a roll-out adds up
/// what is left. The logarithm lets go of laws whose share is far from 1: it moves 1 − r by less
/// than kWholePull δ/(2 kNearlyWhole).
constexpr double kWholePull = 0.03, kNearlyWhole = 0.01;

}  // namespace

Objective::Objective(const LawColumns& columns, const LossOptions& loss, const ObjectiveOps& ops)
    : form_(columns.form),
      measure_(loss.measure()),
      squared_(loss.squared),
      ops_(ops),
      columns_(columns.values) {
  if (squared_ && form_ == kernels::LawForm::isotropic) {
    throw Error("loss: expected logarithm, the only one of form isotropic, found squared");
  }
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
  const Tensor e = (kernels::kStrainScale * torch::exp(kernels::kStrainRate * z.select(1, 1)))
                       .unsqueeze(1)
                       .unsqueeze(2);
  const Tensor delta =
      kernels::kDeltaOverStrain * e *
      ops_.mlp(columns(Column::projection_in, 30) / e, z, networks.projection, networks.activation);
  const Tensor true_delta = columns(Column::delta, 9);
  const Tensor strain_rms = scale.select(1, 1).unsqueeze(1);
  const Tensor decrease_rms = scale.select(1, 2).unsqueeze(1);
  const Tensor unit = torch::where(decrease_rms > 0, decrease_rms, strain_rms);
  const Tensor projection_square = square(delta - true_delta).sum(2);
  const Tensor projection = projection_square / (square(true_delta).sum(2) +
                                                 square(measure_.floor * unit) + kLeastSquare);
  const Tensor state =
      torch::cat({columns(Column::stress_in, 16) / e, columns(Column::rate_in, 9)}, 2);
  const Tensor s1 = ops_.mlp(state, z, networks.stress, networks.activation);
  const Tensor matrix = s1.view({s1.size(0), s1.size(1), 3, 3});
  const Tensor symmetric = 0.5 * (matrix + matrix.transpose(2, 3)).reshape(s1.sizes());
  const Tensor tau = columns(Column::stress, 9);
  const Tensor stress_rms = scale.select(1, 0).unsqueeze(1);
  const Tensor stress_square = square(s.unsqueeze(1).unsqueeze(2) * symmetric - tau).sum(2);
  const Tensor stress =
      stress_square / (square(tau).sum(2) + square(measure_.floor * stress_rms) + kLeastSquare);
  const auto loss = [this](const Tensor& error, const Tensor& squares, const Tensor& rms) {
    return (squared_ ? squares / (square(rms) + kLeastSquare)
                     : torch::log1p(error / measure_.delta))
        .mean(1);
  };
  return {loss(stress, stress_square, stress_rms),
          loss(projection, projection_square, unit),
          {},
          {},
          {},
          stress.detach().mean(1),
          projection.detach().mean(1)};
}

Tensor Objective::loss(const LawErrors& e, ReturnStage stage) {
  if (!e.share.defined()) return e.stress_loss + e.projection_loss;
  const Tensor others = e.stress_loss + kPowerPull * e.power;
  const Tensor left = (1.0 - e.share).abs();
  if (stage == ReturnStage::actual)
    return others + e.projection_loss + kWholePull * torch::log1p(left / kNearlyWhole);
  const Tensor whole = e.whole_loss + left;
  return others + (stage == ReturnStage::whole ? whole : torch::minimum(e.projection_loss, whole));
}

double median_root(const Tensor& errors) { return errors.sqrt().median().item<double>(); }

}  // namespace uniphy
