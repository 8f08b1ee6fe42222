#pragma once

#include <memory>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::bench {

/// An untrained learned law of the size that the goals are about: isotropic 3×32 with 8 latent
/// numbers and silu, published 4x128 with 32 and gelu. Its answers are tame: roll-outs with it stay
/// in the box. The speed of a law does not depend on its weights.
std::shared_ptr<const kernels::LearnedLawWeights> random_law(kernels::LawForm form);

/// A latent code for it.
std::vector<double> random_code(const kernels::LearnedLawWeights& weights);

/// Multiply-adds of both networks for one particle, the latent folded into the first bias.
double multiply_adds_of(const kernels::LearnedLawWeights& weights);

}  // namespace uniphy::bench
