#pragma once

#include <torch/types.h>

#include <vector>

#include "ops/base/matrices.hpp"
#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/laws/law_table.hpp"

// What the ops of the analytic laws share: the material as tensors.

namespace uniphy::ops {

/// A material parameter: a number, or a tensor of shape [] or [1] that gradients reach.
class Parameter {
 public:
  Parameter() : Parameter(0.0) {}
  Parameter(double value);          // NOLINT(google-explicit-constructor)
  Parameter(torch::Tensor tensor);  // NOLINT(google-explicit-constructor)

  const torch::Tensor& tensor() const { return tensor_; }

 private:
  torch::Tensor tensor_;
};

/// One material for all particles of a call. A law looks only at the parameters that it has
/// (kernels::law_parameters); the gradient of the others is zero.
struct Material {
  Parameter mu;        ///< Pa (Pa s for newtonian)
  Parameter lambda;    ///< Pa
  Parameter tau_y;     ///< Pa
  Parameter theta;     ///< rad
  Parameter eta;       ///< Pa s
  Parameter c1, c2;    ///< Pa
  Parameter eta_inf;   ///< Pa s
  Parameter kappa;     ///< s
  Parameter n;         ///< flow index
  Parameter cohesion;  ///< strain
};
/// Its members in the order of kernels::kLawParameterTable.
inline constexpr Parameter Material::*kMaterialMembers[kernels::kLawParameters] = {
    &Material::mu,    &Material::lambda, &Material::tau_y,   &Material::theta,
    &Material::eta,   &Material::c1,     &Material::c2,      &Material::eta_inf,
    &Material::kappa, &Material::n,      &Material::cohesion};

/// The material of an analytic law: its numbers; or those of `parameters` [N], in the order of
/// kernels::law_parameters(law), which gradients reach. `op` opens the message of the Error where
/// the length or the type is another.
Material material_of(const kernels::LawDescription& law);
Material material_of(const char* op, kernels::LawId law, const torch::Tensor& parameters);

/// All parameters in the order of kernels::kLawParameterTable as one float64 tensor [5];
/// differentiable. `op` opens the message of the Error where a tensor is not a single
/// floating-point number on the CPU or where the law cannot have the value.
torch::Tensor pack_material(const char* op, kernels::LawId law, const Material& material);

/// The same numbers for the kernels.
template <class T>
kernels::LawParameters<T> law_parameters(const torch::Tensor& packed);

/// for_each_block with a LawParameters<T>* for each block to add its share of the gradient to;
/// their sum in order of blocks, as a tensor like `packed`. Where no gradient is wanted, the
/// pointer is null and the result undefined.
template <class T, class Body>
torch::Tensor sum_over_blocks(std::ptrdiff_t particles, const torch::Tensor& packed, bool wanted,
                              const Body& body) {
  std::vector<kernels::LawParameters<T>> shares(
      static_cast<std::size_t>((particles + kParticleBlock - 1) / kParticleBlock));
  for_each_block(particles, [&](std::ptrdiff_t first, std::ptrdiff_t count) {
    body(first, count,
         wanted ? &shares[static_cast<std::size_t>(first / kParticleBlock)] : nullptr);
  });
  if (!wanted) return {};
  torch::Tensor sum = at::zeros_like(packed);
  double* total = sum.data_ptr<double>();
  for (const auto& share : shares) {
    for (int i = 0; i < kernels::kLawParameters; ++i)
      total[i] += double(share.*kernels::kLawParameterMembers<T>[i]);
  }
  return sum;
}

}  // namespace uniphy::ops
