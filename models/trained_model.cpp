#include "models/trained_model.hpp"

namespace uniphy::models {

TrainedModel trained_model(const ModelFile& file, torch::Dtype dtype) {
  return {LearnedLaw(file.weights, dtype), LatentCodes(file, dtype)};
}

ModelFile model_file(const TrainedModel& model, const std::string& config,
                     const std::array<double, 2>& training_dt) {
  ModelFile file;
  file.weights = model.law->weights();
  model.codes->store(file);
  file.config = config;
  file.training_dt = training_dt;
  return file;
}

}  // namespace uniphy::models
