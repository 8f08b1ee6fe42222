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
  /// Draws z [N, latent_size] from a normal distribution. materials and parameters: [N]. Throws
  /// Error where their lengths differ.
  LatentCodesImpl(std::int64_t latent_size, std::vector<std::string> materials,
                  std::vector<MaterialParameters> parameters, double deviation = 0.1,
                  std::uint64_t seed = 0, torch::Dtype dtype = torch::kFloat32);
  explicit LatentCodesImpl(const ModelFile& file, torch::Dtype dtype = torch::kFloat32);

  /// Writes z, the names and the parameters into the file's fields.
  void store(ModelFile& file) const;

  /// Code i, [latent_size]; the codes of rows [S] (int64) are [S, latent_size].
  torch::Tensor code(std::int64_t i) const { return z[i]; }
  torch::Tensor codes(const torch::Tensor& rows) const { return z.index_select(0, rows); }
  std::int64_t size() const { return z.size(0); }
  std::int64_t latent_size() const { return z.size(1); }
  const std::vector<std::string>& materials() const { return materials_; }
  const std::vector<MaterialParameters>& material_parameters() const { return parameters_; }
  /// Rows of one material, int64 [n].
  torch::Tensor rows_of(const std::string& material) const;

  torch::Tensor z;  ///< [N, latent_size], the parameter

 private:
  std::vector<std::string> materials_;
  std::vector<MaterialParameters> parameters_;
};
TORCH_MODULE(LatentCodes);

}  // namespace uniphy::models
