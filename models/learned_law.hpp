#pragma once

#include <torch/nn.h>

#include <cstdint>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/reference/learned_law.hpp"

namespace uniphy::models {

/// The size and kind of a learned law.
struct LearnedLawOptions {
  kernels::LawForm form = kernels::LawForm::isotropic;
  kernels::Activation activation = kernels::Activation::silu;
  std::int64_t latent_size = 8;
  std::vector<std::int64_t> projection_hidden = {32, 32, 32};  ///< widths; may be empty
  std::vector<std::int64_t> stress_hidden = {32, 32, 32};
  std::uint64_t seed = 0;
  torch::Dtype dtype = torch::kFloat32;
};

/// The learned law as a torch module: its parameters are the weights and biases of both networks
/// ("projection_weight_0", ...), differentiable like z, F and C. Gradients are finite everywhere;
/// in the isotropic form they are exact at equal singular values too. The networks run through the
/// fused op (ops/mlp/mlp.hpp). For a fixed model with one latent ops/learned/learned_law.hpp is
/// much faster.
///
///   LearnedLaw law(options);
///   Tensor F_proj = law->project(F, z), tau = law->stress(F_proj, C, z);
class LearnedLawImpl : public torch::nn::Module {
 public:
  /// Hidden layers are drawn from a normal distribution of variance 2/in (He et al. 2015), the last
  /// ones a tenth of that, so that a new law is soft; biases are 0 but for the caps of the
  /// isotropic form, which start at a few strain scales. Throws Error for a size that is not
  /// positive.
  explicit LearnedLawImpl(const LearnedLawOptions& options);
  /// Throws Error where the weights do not fit (LearnedLawWeights::check).
  explicit LearnedLawImpl(const kernels::LearnedLawWeights& weights,
                          torch::Dtype dtype = torch::kFloat32);

  /// The numbers without torch, for the kernels and for model files.
  kernels::LearnedLawWeights weights() const;

  /// F, F_proj, C [P, 3, 3] (1, 1, 1/s), z [Z] or [P, Z] → [P, 3, 3] (1, Pa). Throws Error naming
  /// the argument whose shape or type differs from what the law takes.
  torch::Tensor project(const torch::Tensor& F, const torch::Tensor& z) const;
  torch::Tensor stress(const torch::Tensor& F_proj, const torch::Tensor& C,
                       const torch::Tensor& z) const;

  /// The tensors behind the parameters, for the step-by-step functions of
  /// ops/reference/learned_law.hpp.
  const ops::reference::LearnedLawTensors& tensors() const { return tensors_; }
  kernels::LawForm form() const { return tensors_.form; }
  kernels::Activation activation() const { return tensors_.activation; }
  std::int64_t latent_size() const { return latent_size_; }
  std::int64_t parameter_count() const;

 private:
  void adopt(const ops::reference::LearnedLawTensors& initial);
  void check(const char* name, const torch::Tensor& F, const torch::Tensor& z) const;

  std::int64_t latent_size_;
  ops::reference::LearnedLawTensors tensors_;
};
TORCH_MODULE(LearnedLaw);

}  // namespace uniphy::models
