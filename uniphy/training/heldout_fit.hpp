#pragma once

#include <memory>
#include <vector>

#include "uniphy/config/config.hpp"
#include "uniphy/training/law_error.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {

/// What a trained law is worth on trajectories that it never saw: z alone is fitted to the samples
/// of each (fit_latents, no roll-out), and the law errors are those of the fitted codes.
struct HeldoutFit {
  std::vector<double> latents;   ///< [trajectories, latent_size]
  std::vector<LawError> errors;  ///< [trajectories]
};

/// training_z: [codes, latent_size], where the fits start.
HeldoutFit fit_heldout(const Dataset& data, const Networks& networks,
                       const torch::Tensor& training_z,
                       const std::shared_ptr<const kernels::LearnedLawWeights>& weights,
                       const LatentFitOptions& options);

/// Declares and reads the section `fit`.
LatentFitOptions read_latent_fit_options(Section& config);

/// A tensor's numbers as float64, row-major.
std::vector<double> numbers_of(const torch::Tensor& tensor);

}  // namespace uniphy
