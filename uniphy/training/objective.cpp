#include "uniphy/training/objective.hpp"

#include <cmath>

namespace uniphy {
namespace {

using torch::square;
using torch::Tensor;

/// The network on [N, m, features] with z [N, Z] beside every sample → [N, m, out].
Tensor network(const ops::FlatLayers& layers, const Networks& networks, const Tensor& features,
               const Tensor& z) {
  return ops::mlp(features, z, layers, networks.options.activation);
}

}  // namespace

Objective::Objective(const LawColumns& columns, kernels::LawForm form,
                     const ops::ErrorMeasure& measure)
    : form_(form), measure_(measure) {
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
  const Tensor scale = scales_.index_select(0, scale_rows);
  return form_ == kernels::LawForm::isotropic ? isotropic(networks, z, rows, scale)
                                              : published(networks, z, rows, scale);
}

LawErrors Objective::isotropic(const Networks& networks, const Tensor& z, const Tensor& rows,
                               const Tensor& scale) const {
  const std::int64_t n = z.size(0);
  const ops::IsotropicBatch batch{columns_, rows};
  const NetworkOptions& options = networks.options;
  ops::IsotropicFeatures features;
  if (options.state_caps || options.state_moduli) features = ops::isotropic_features(batch, z);
  ops::IsotropicAnswers answers;
  answers.caps_rest = network(networks.projection, networks, torch::zeros({n, 1, 3}), z);
  answers.caps = options.state_caps ? network(networks.projection, networks, features.projection, z)
                                    : answers.caps_rest;
  answers.moduli_rest = network(networks.stress, networks, torch::zeros({n, 1, 6}), z);
  answers.moduli = options.state_moduli ? network(networks.stress, networks, features.stress, z)
                                        : answers.moduli_rest;
  const ops::LawLosses e = ops::law_losses(batch, scale, z, answers, measure_);
  const auto loss = [&e](kernels::IsotropicMean k) { return e.losses.select(1, k); };
  return {loss(kernels::kStressLoss), loss(kernels::kProjectionLoss), loss(kernels::kWholeLoss),
          loss(kernels::kShare),      e.errors.select(1, 0),          e.errors.select(1, 1)};
}

LawErrors Objective::published(const Networks& networks, const Tensor& z, const Tensor& rows,
                               const Tensor& scale) const {
  using Column = PublishedColumns;
  const Tensor batch = columns_.index_select(0, rows.reshape({-1}))
                           .view({rows.size(0), rows.size(1), columns_.size(1)});
  const auto columns = [&batch](int first, int count) { return batch.narrow(2, first, count); };
  const Tensor s = kernels::kStressScale * torch::exp(kernels::kStressRate * z.select(1, 0));
  const Tensor delta =
      network(networks.projection, networks, columns(Column::projection_in, 30), z);
  const Tensor true_delta = columns(Column::delta, 9);
  const Tensor strain_rms = scale.select(1, 1).unsqueeze(1);
  const Tensor decrease_rms = scale.select(1, 2).unsqueeze(1);
  const Tensor unit = torch::where(decrease_rms > 0, decrease_rms, strain_rms);
  const Tensor projection = square(delta - true_delta).sum(2) /
                            (square(true_delta).sum(2) + square(measure_.floor * unit) + 1e-20);
  const Tensor s1 = network(networks.stress, networks, columns(Column::stress_in, 25), z);
  const Tensor matrix = s1.view({s1.size(0), s1.size(1), 3, 3});
  const Tensor symmetric = 0.5 * (matrix + matrix.transpose(2, 3)).reshape(s1.sizes());
  const Tensor tau = columns(Column::stress, 9);
  const Tensor stress =
      square(s.unsqueeze(1).unsqueeze(2) * symmetric - tau).sum(2) /
      (square(tau).sum(2) + square(measure_.floor * scale.select(1, 0)).unsqueeze(1) + 1e-20);
  const auto loss = [this](const Tensor& error) {
    return torch::log1p(error / measure_.delta).mean(1);
  };
  return {loss(stress), loss(projection),        {},
          {},           stress.detach().mean(1), projection.detach().mean(1)};
}

Tensor Objective::loss(const LawErrors& e, ReturnStage stage) {
  if (!e.share.defined() || stage == ReturnStage::actual) return e.stress_loss + e.projection_loss;
  const Tensor whole = e.whole_loss + (1.0 - e.share).abs();
  return e.stress_loss +
         (stage == ReturnStage::whole ? whole : torch::minimum(e.projection_loss, whole));
}

double median_root(const Tensor& errors) { return errors.sqrt().median().item<double>(); }

}  // namespace uniphy
