#pragma once

#include <memory>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/learned/learned_law_table.hpp"

namespace uniphy::kernels {

/// The kernel of a trained model with one latent code: description.weights and description.z.
/// Throws Error where the weights are missing or do not fit, or z has another length or is not
/// finite.
template <class T>
std::shared_ptr<const LawKernel<T>> make_learned_law(const LawDescription& description);

}  // namespace uniphy::kernels
