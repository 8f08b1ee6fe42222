#pragma once

#include <torch/nn.h>

#include <cstdint>
#include <string>
#include <vector>

#include "uniphy/io/dataset.hpp"
#include "uniphy/io/model_file.hpp"

namespace uniphy::models {

/// The auto-decoder's table: one latent code for each training trajectory, with the name and the
/// parameters of the material behind it (which no network sees).
class LatentCodesImpl : public torch::nn::Module {
 public:
  /// z: [N, latent_size], whose numbers become the parameter. materials and parameters: [N]. Throws
  /// Error where their lengths differ.
  LatentCodesImpl(const torch::Tensor& z, std::vector<std::string> materials,
                  std::vector<MaterialParameters> parameters);
  explicit LatentCodesImpl(const ModelFile& file, torch::Dtype dtype = torch::kFloat32);

  /// Writes z, the names and the parameters into the file's fields.
  void store(ModelFile& file) const;

  std::int64_t size() const { return z.size(0); }
  std::int64_t latent_size() const { return z.size(1); }
  const std::vector<std::string>& materials() const { return materials_; }
  const std::vector<MaterialParameters>& material_parameters() const { return parameters_; }

  torch::Tensor z;  ///< [N, latent_size], the parameter

 private:
  std::vector<std::string> materials_;
  std::vector<MaterialParameters> parameters_;
};
TORCH_MODULE(LatentCodes);

}  // namespace uniphy::models
