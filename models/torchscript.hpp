#pragma once

// A trained law as a TorchScript file that runs without this project, in C++ and in Python:
//
//   python3 -c "import torch; m = torch.jit.load('law.pt'); z = m.code_of('sand')
//   F = torch.eye(3)[None].requires_grad_(); m.project(F, z).sum().backward(); print(F.grad)"
//
//   methods     project(F, z, dt = 2e-4) → F_proj, dt the time step (s) that a viscoplastic law
//               depends on (the published form does not), and stress(F_proj, C, z) → tau; F,
//               F_proj, C [P, 3, 3], P ≥ 0, z [latent_size] or [P, latent_size], float32 or
//               float64, finite; anything else is an error that names the argument. Computed in
//               `dtype`, answered in the dtype of F. code_of(material) → z [latent_size] of the
//               first training trajectory of a material
//   attributes  format = "uniphy-torchscript-law", version = 3, form, activation, latent_size,
//               dtype = "float32" | "float64", units = "F: 1, C: 1/s, z: 1, tau: Pa",
//               materials [N] names of the laws behind the training codes,
//               parameter_names and parameter_units [5] of the columns of material_parameters,
//               constants {name: number} of the formulas (models/script/eager.py)
//   buffers     codes [N, latent_size] in `dtype`, the codes of the training trajectories, and
//               material_parameters [N, 5] float64, NaN where a law has none. A code by its
//               parameters:  m.codes[i] for i with m.materials[i], m.material_parameters[i]
//               projection_weight_k [out, in], projection_bias_k [out], stress_... alike
//
// Derivatives. The first, by F, F_proj, C and z, is right at every F of the isotropic form, equal
// singular values included (by divided differences, as in the kernels); where two singular values
// sum to 0 (det F < 0, rank ≤ 1) the rotation jumps and the answer is bounded as in
// ops/kernels/spectral/spectral.hpp. The published form has no derivative at equal singular values
// (published_law.hpp); there the answer is the kernels', finite, with U and V held. Where F
// requires a gradient a second derivative by anything is refused: PyTorch says that "the
// derivative for '_cdist_backward' is not implemented". Where it does not, those by C and z are
// PyTorch's own. Without a gradient of F none of this is computed.
//
// The methods are models/script/*.py. The archive also holds the attributes as JSON,
// extra/metadata.json.

#include <torch/script.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ops/kernels/laws/law_parameters.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"

namespace uniphy::models {

inline constexpr const char* kScriptFormat = "uniphy-torchscript-law";
inline constexpr std::int64_t kScriptVersion = 3;
inline constexpr const char* kScriptUnits = "F: 1, C: 1/s, z: 1, tau: Pa";

/// The columns of material_parameters; a newtonian law's mu is in Pa s.
inline constexpr auto kScriptParameterNames = [] {
  std::array<const char*, kernels::kFamilyParameters> names{};
  for (int i = 0; i < kernels::kFamilyParameters; ++i)
    names[i] = kernels::kLawParameterTable[i].name;
  return names;
}();
inline constexpr auto kScriptParameterUnits = [] {
  std::array<const char*, kernels::kFamilyParameters> units{};
  for (int i = 0; i < kernels::kFamilyParameters; ++i)
    units[i] = kernels::kLawParameterTable[i].unit;
  return units;
}();

/// The training codes that a file carries; none by default.
struct ScriptCodes {
  std::vector<double> z;               ///< [N, latent_size]
  std::vector<std::string> materials;  ///< [N]
  std::vector<std::array<double, kernels::kFamilyParameters>>
      parameters;  ///< [N], NaN where the law has none
};

/// The module of a law; dtype is float32 or float64. Throws Error where the weights or the codes do
/// not fit.
torch::jit::Module script_law(const kernels::LearnedLawWeights& weights, torch::Dtype dtype,
                              const ScriptCodes& codes = {});

/// The bytes of its file, made in memory: LibTorch's own file writer ends the program where the
/// disk is full.
std::string script_law_bytes(const kernels::LearnedLawWeights& weights, torch::Dtype dtype,
                             const ScriptCodes& codes = {});

/// A loaded law whose attributes, methods and buffers were checked.
struct ScriptLaw {
  mutable torch::jit::Module module;
  kernels::LawForm form;
  std::int64_t latent_size;
  torch::Dtype dtype;

  torch::Tensor project(const torch::Tensor& F, const torch::Tensor& z,
                        double dt = kernels::kFlowStep) const;
  torch::Tensor stress(const torch::Tensor& F_proj, const torch::Tensor& C,
                       const torch::Tensor& z) const;
  torch::Tensor code_of(const std::string& material) const;
  std::vector<std::string> materials() const;
};

/// Throws Error naming the file and what differs (no such file, not a TorchScript archive, damaged,
/// format, version, units, dtype, shapes, methods), the expected and the found value. With `dtype`
/// the file must hold that one.
ScriptLaw load_script_law(const std::filesystem::path& file,
                          std::optional<torch::Dtype> dtype = std::nullopt);

}  // namespace uniphy::models
