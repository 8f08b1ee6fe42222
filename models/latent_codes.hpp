#pragma once

#include <torch/nn.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "ops/kernels/laws/law_parameters.hpp"

namespace uniphy::models {

/// The parameters of a material: in the order and the units of kernels::kLawParameterTable, NaN
/// where its law has none.
using CodeParameters = std::array<double, kernels::kFamilyParameters>;

/// The auto-decoder's table: one latent code for each training trajectory, with the name and the
/// parameters of the material behind it (which no network sees).
class LatentCodesImpl : public torch::nn::Module {
 public:
  /// z: [N, latent_size], whose numbers become the parameter. materials and parameters: [N]. Throws
  /// Error where their lengths differ.
  LatentCodesImpl(const torch::Tensor& z, std::vector<std::string> materials,
                  std::vector<CodeParameters> parameters);

  std::int64_t size() const { return z.size(0); }
  std::int64_t latent_size() const { return z.size(1); }
  const std::vector<std::string>& materials() const { return materials_; }
  const std::vector<CodeParameters>& material_parameters() const { return parameters_; }

  torch::Tensor z;  ///< [N, latent_size], the parameter

 private:
  std::vector<std::string> materials_;
  std::vector<CodeParameters> parameters_;
};
TORCH_MODULE(LatentCodes);

}  // namespace uniphy::models
