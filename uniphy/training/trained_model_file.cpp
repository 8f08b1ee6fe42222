#include "uniphy/training/trained_model_file.hpp"

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

torch::Tensor codes_of(const ModelFile& file, torch::Dtype dtype) {
  const std::int64_t n = file.codes(), size = file.weights.latent_size;
  if (std::int64_t(file.latents.size()) != n * size)
    throw Error("latent codes: expected " + std::to_string(n * size) + " numbers, found " +
                std::to_string(file.latents.size()));
  return torch::tensor(file.latents, torch::kFloat64).view({n, size}).to(dtype);
}

}  // namespace

models::TrainedModel trained_model(const ModelFile& file, torch::Dtype dtype) {
  return {models::LearnedLaw(file.weights, dtype),
          models::LatentCodes(codes_of(file, dtype), file.materials, file.parameters)};
}

ModelFile model_file(const models::TrainedModel& model, const std::string& config,
                     const std::array<double, 2>& training_dt) {
  ModelFile file;
  file.weights = model.law->weights();
  const torch::Tensor z = model.codes->z.detach().to(torch::kFloat64).contiguous();
  file.latents.assign(z.data_ptr<double>(), z.data_ptr<double>() + z.numel());
  file.materials = model.codes->materials();
  file.parameters = model.codes->material_parameters();
  file.config = config;
  file.training_dt = training_dt;
  return file;
}

}  // namespace uniphy
