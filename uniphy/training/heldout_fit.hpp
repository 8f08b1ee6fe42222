#pragma once

#include <memory>
#include <vector>

#include "uniphy/training/latent_fit.hpp"
#include "uniphy/training/law_error.hpp"

namespace uniphy {

/// What a trained law is worth on trajectories that it never saw: z alone is fitted to the samples
/// of each (fit_latents, no roll-out), and the law errors are those of the fitted codes.
struct HeldoutFit {
  std::vector<double> latents;   ///< [trajectories, latent_size]
  std::vector<LawError> errors;  ///< [trajectories]
};

/// columns: those of the data. The fits start at codes of the model; weights: those of its law, as
/// they simulate.
HeldoutFit fit_heldout(const Dataset& data, const LawColumns& columns,
                       const models::TrainedModel& model,
                       const std::shared_ptr<const kernels::LearnedLawWeights>& weights,
                       const LatentFitOptions& options);

/// A tensor's numbers as float64, row-major.
std::vector<double> numbers_of(const torch::Tensor& tensor);

}  // namespace uniphy
