#include "models/latent_codes.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <torch/torch.h>

#include <utility>

#include "ops/kernels/base/error.hpp"

namespace uniphy::models {

LatentCodesImpl::LatentCodesImpl(std::int64_t latent_size, std::vector<std::string> materials,
                                 std::vector<MaterialParameters> parameters, double deviation,
                                 std::uint64_t seed, torch::Dtype dtype)
    : materials_(std::move(materials)), parameters_(std::move(parameters)) {
  if (latent_size < 0)
    throw Error("latent codes: latent_size: expected 0 or more numbers, found " +
                std::to_string(latent_size));
  if (parameters_.size() != materials_.size())
    throw Error("latent codes: parameters: expected " + std::to_string(materials_.size()) +
                " rows, one for each material, found " + std::to_string(parameters_.size()));
  torch::Generator generator = at::make_generator<at::CPUGeneratorImpl>(seed);
  const auto drawn = torch::empty({std::int64_t(materials_.size()), latent_size}, torch::kFloat64)
                         .normal_(0, deviation, generator);
  z = register_parameter("z", drawn.to(dtype));
}

LatentCodesImpl::LatentCodesImpl(const ModelFile& file, torch::Dtype dtype)
    : LatentCodesImpl(file.weights.latent_size, file.materials, file.parameters, 0, 0, dtype) {
  if (std::int64_t(file.latents.size()) != z.numel())
    throw Error("latent codes: expected " + std::to_string(z.numel()) + " numbers, found " +
                std::to_string(file.latents.size()));
  const torch::NoGradGuard guard;
  z.copy_(torch::tensor(file.latents, torch::kFloat64).reshape(z.sizes()));
}

void LatentCodesImpl::store(ModelFile& file) const {
  const torch::Tensor flat = z.detach().to(torch::kFloat64).contiguous();
  file.latents.assign(flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel());
  file.materials = materials_;
  file.parameters = parameters_;
}

torch::Tensor LatentCodesImpl::rows_of(const std::string& material) const {
  std::vector<std::int64_t> rows;
  for (std::size_t i = 0; i < materials_.size(); ++i)
    if (materials_[i] == material) rows.push_back(std::int64_t(i));
  return torch::tensor(rows, torch::kInt64);
}

}  // namespace uniphy::models
