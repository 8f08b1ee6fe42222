#pragma once

#include <memory>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/laws/law_table.hpp"

namespace uniphy::kernels {

/// Throws Error naming the law and the first parameter that is not finite or outside of its range
/// (law_parameters.hpp), and for a learned law. Parameters that the law lacks are not read.
void check_parameters(const LawDescription& description);

/// An analytic law on a given instruction set (the one in use, for make_law), with the checks of
/// check_parameters.
template <class T>
std::shared_ptr<const LawKernel<T>> make_analytic_law(const LawDescription& description,
                                                      Isa isa = active_isa());

}  // namespace uniphy::kernels
