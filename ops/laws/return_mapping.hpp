#pragma once

#include <torch/types.h>

#include "ops/laws/material.hpp"

namespace uniphy::ops {

/// F_proj = G(F): the projection of an analytic law (formulas: von_mises.hpp, drucker_prager.hpp,
/// viscoplastic.hpp, volumetric.hpp in ops/kernels; F itself for a law that never yields). Of a law
/// without memory.
/// F [P, 3, 3], float32 or float64, on the CPU; dt in s, used by non_newtonian alone.
///
/// Differentiable, once, with respect to F and every parameter, by divided differences: exact at
/// equal singular values and on either side of the yield surface. Where a particle does not yield,
/// F and its gradient pass bit for bit. The same bits on any number of threads.
/// Throws Error naming the argument, what was expected and what was found.
torch::Tensor return_mapping(kernels::LawId law, const torch::Tensor& F, const Material& material,
                             double dt);

struct MemoryMapping {
  torch::Tensor F_proj;  ///< [P, 3, 3]
  torch::Tensor memory;  ///< [P], after the step
};
/// The same for a law with memory (kernels::law_has_memory; particle_memory.hpp in ops/kernels):
/// memory [P] before the step, 0 at the start. Differentiable by it too.
MemoryMapping return_mapping_with_memory(kernels::LawId law, const torch::Tensor& F,
                                         const torch::Tensor& memory, const Material& material,
                                         double dt);

}  // namespace uniphy::ops
