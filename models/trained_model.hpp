#pragma once

#include <array>
#include <string>

#include "models/latent_codes.hpp"
#include "models/learned_law.hpp"

namespace uniphy::models {

/// A learned law with the codes of the trajectories that it was trained on: what model.h5 keeps
/// (uniphy/io/model_file.hpp).
struct TrainedModel {
  LearnedLaw law{nullptr};
  LatentCodes codes{nullptr};
};

TrainedModel trained_model(const ModelFile& file, torch::Dtype dtype = torch::kFloat32);

/// config: the YAML that trained it; training_dt: see ModelFile.
ModelFile model_file(const TrainedModel& model, const std::string& config,
                     const std::array<double, 2>& training_dt = {});

}  // namespace uniphy::models
