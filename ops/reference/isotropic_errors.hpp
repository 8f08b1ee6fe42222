#pragma once

#include "ops/isotropic_errors.hpp"

namespace uniphy::ops::reference {

/// ops::isotropic_features and ops::isotropic_errors in plain tensor operations.
IsotropicFeatures isotropic_features(const IsotropicBatch& batch, const torch::Tensor& z);
IsotropicErrors isotropic_errors(const IsotropicBatch& batch, const torch::Tensor& scales,
                                 const torch::Tensor& z, const IsotropicAnswers& answers,
                                 const ErrorMeasure& measure);

}  // namespace uniphy::ops::reference
