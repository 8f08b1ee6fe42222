#pragma once

// model.h5: a trained law and the latent codes of the trajectories it was trained on.
//
//   attributes  format = "uniphy-model", version = 2, form = "isotropic" | "published",
//               latent_size, activation = "gelu" | "silu" | "squareplus", dtype = "float64",
//               stress_units = "Pa", rate_units = "1/s", config = YAML that trained it,
//               training_dt [2] = shortest and longest time step (s) of the training trajectories;
//               a file without it does not know
//   /projection/layer_k/weight [out, in], bias [out]   k = 0, 1, ...
//   /stress/layer_k/weight     [out, in], bias [out]
//   /latents/z          [N, latent_size]
//   /latents/material   [N]     name of the law behind each code
//   /latents/parameters [N, 5]  mu, lambda, tau_y, theta, eta of that law, NaN where it has none
//
// The inputs of the first layers, their order and units:
// ops/kernels/learned/learned_law_weights.hpp.

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

struct ModelFile {
  kernels::LearnedLawWeights weights;
  std::vector<double> latents;                 ///< [N, latent_size]
  std::vector<std::string> materials;          ///< [N]
  std::vector<MaterialParameters> parameters;  ///< [N]
  std::string config;
  std::array<double, 2> training_dt{};  ///< s; 0: not known

  std::int64_t codes() const { return static_cast<std::int64_t>(materials.size()); }
  /// Code i, latent_size numbers.
  std::vector<double> code(std::int64_t i) const;
};

/// With `single_precision` the weights are stored as float32 (dtype = "float32"), half the size.
void write_model(const std::filesystem::path& file, const ModelFile& model,
                 bool single_precision = false);
/// Throws Error naming the attribute or dataset where the format, the version, the units, the
/// shapes or the numbers (finite) are not as above.
ModelFile read_model(const std::filesystem::path& file);

}  // namespace uniphy
