#pragma once

#include <torch/types.h>

#include <array>
#include <string>

#include "models/trained_model.hpp"
#include "uniphy/io/model_file.hpp"

namespace uniphy {

/// What model.h5 keeps, as torch modules. Throws Error where the number of codes is another one
/// than the file says.
models::TrainedModel trained_model(const ModelFile& file, torch::Dtype dtype = torch::kFloat32);

/// config: the YAML that trained it; training_dt: see ModelFile.
ModelFile model_file(const models::TrainedModel& model, const std::string& config,
                     const std::array<double, 2>& training_dt = {});

}  // namespace uniphy
