#pragma once

// A trained law as a TorchScript file that runs without this project, in C++ and in Python:
//
//   python3 -c "import torch; m=torch.jit.load('law.pt');
//               print(m.project(torch.eye(3)[None], torch.zeros(m.latent_size)))"
//
//   methods     project(F, z) → F_proj and stress(F_proj, C, z) → tau; F, F_proj, C [P, 3, 3],
//               P ≥ 0, z [latent_size] or [P, latent_size]. Computed in `dtype`, answered in the
//               dtype of F. Not for differentiation at equal singular values.
//   attributes  format = "uniphy-torchscript-law", version = 1, form, activation, latent_size,
//               dtype = "float32" | "float64", units = "F: 1, C: 1/s, z: 1, tau: Pa"
//   buffers     projection_weight_k [out, in], projection_bias_k [out], stress_... alike
//
// The archive also holds the attributes as JSON, extra/metadata.json.

#include <torch/script.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::models {

inline constexpr const char* kScriptFormat = "uniphy-torchscript-law";
inline constexpr std::int64_t kScriptVersion = 1;
inline constexpr const char* kScriptUnits = "F: 1, C: 1/s, z: 1, tau: Pa";

/// The module of a law; dtype is float32 or float64. Throws Error where the weights do not fit.
torch::jit::Module script_law(const kernels::LearnedLawWeights& weights, torch::Dtype dtype);

/// Writes `<file>.tmp` and renames it.
void save_script_law(const std::filesystem::path& file, const kernels::LearnedLawWeights& weights,
                     torch::Dtype dtype);

/// A loaded law whose attributes, methods and buffers were checked.
struct ScriptLaw {
  mutable torch::jit::Module module;
  kernels::LawForm form;
  std::int64_t latent_size;
  torch::Dtype dtype;

  torch::Tensor project(const torch::Tensor& F, const torch::Tensor& z) const;
  torch::Tensor stress(const torch::Tensor& F_proj, const torch::Tensor& C,
                       const torch::Tensor& z) const;
};

/// Throws Error naming the file and what differs (no such file, not a TorchScript archive, damaged,
/// format, version, units, dtype, shapes, methods), the expected and the found value. With `dtype`
/// the file must hold that one.
ScriptLaw load_script_law(const std::filesystem::path& file,
                          std::optional<torch::Dtype> dtype = std::nullopt);

}  // namespace uniphy::models
