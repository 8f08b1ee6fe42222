#pragma once

#include "ops/loss/law_losses.hpp"

namespace uniphy::ops::reference {

/// ops::isotropic_features and ops::law_losses in plain tensor operations.
IsotropicFeatures isotropic_features(const IsotropicBatch& batch, const torch::Tensor& z);
LawLosses law_losses(const IsotropicBatch& batch, const torch::Tensor& scales,
                     const torch::Tensor& z, const IsotropicAnswers& answers,
                     const ErrorMeasure& measure);

}  // namespace uniphy::ops::reference
