#include "models/latent_codes.hpp"

#include <torch/torch.h>

#include <utility>

#include "ops/kernels/base/error.hpp"

namespace uniphy::models {
namespace {

torch::Tensor codes_of(const ModelFile& file, torch::Dtype dtype) {
  const std::int64_t n = file.codes(), size = file.weights.latent_size;
  if (std::int64_t(file.latents.size()) != n * size)
    throw Error("latent codes: expected " + std::to_string(n * size) + " numbers, found " +
                std::to_string(file.latents.size()));
  return torch::tensor(file.latents, torch::kFloat64).view({n, size}).to(dtype);
}

}  // namespace

LatentCodesImpl::LatentCodesImpl(const torch::Tensor& initial, std::vector<std::string> materials,
                                 std::vector<MaterialParameters> parameters)
    : materials_(std::move(materials)), parameters_(std::move(parameters)) {
  const auto expect_rows = [&](const char* what, std::size_t found) {
    if (std::int64_t(found) != initial.size(0))
      throw Error(std::string("latent codes: ") + what + ": expected " +
                  std::to_string(initial.size(0)) + " rows, one for each code, found " +
                  std::to_string(found));
  };
  expect_rows("materials", materials_.size());
  expect_rows("parameters", parameters_.size());
  z = register_parameter("z", initial.detach().clone());
}

LatentCodesImpl::LatentCodesImpl(const ModelFile& file, torch::Dtype dtype)
    : LatentCodesImpl(codes_of(file, dtype), file.materials, file.parameters) {}

void LatentCodesImpl::store(ModelFile& file) const {
  const torch::Tensor flat = z.detach().to(torch::kFloat64).contiguous();
  file.latents.assign(flat.data_ptr<double>(), flat.data_ptr<double>() + flat.numel());
  file.materials = materials_;
  file.parameters = parameters_;
}

}  // namespace uniphy::models
