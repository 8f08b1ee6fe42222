#pragma once

#include <memory>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/laws/law_table.hpp"

namespace uniphy::kernels {

/// The places of parameter_names(id) in LawParameters, counted from mu = 0.
/// Throws Error for learned.
std::vector<int> parameter_places(LawId id);

/// Throws Error naming the law and the first parameter that is not finite or not positive; tau_y,
/// theta and eta may be 0, theta must stay below π/2. Parameters that the law lacks are not read.
void check_parameters(const LawDescription& description);

/// An analytic law on a given instruction set (the one in use, for make_law), with the checks of
/// check_parameters.
template <class T>
std::shared_ptr<const LawKernel<T>> make_analytic_law(const LawDescription& description,
                                                      Isa isa = active_isa());

}  // namespace uniphy::kernels
