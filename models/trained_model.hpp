#pragma once

#include "models/latent_codes.hpp"
#include "models/learned_law.hpp"

namespace uniphy::models {

/// A learned law with the codes of the trajectories that it was trained on.
struct TrainedModel {
  LearnedLaw law{nullptr};
  LatentCodes codes{nullptr};
};

}  // namespace uniphy::models
