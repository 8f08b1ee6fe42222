#pragma once

#include "uniphy/stability/planned_cell.hpp"
#include "uniphy/stability/stability_options.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {

/// Gradients of return mapping and Kirchhoff stress at the states of spectral_states.hpp, float64.
///   analytic, raw_svd, clamped_svd, nan_to_zero: plasticine, sand, non_newtonian
///   isotropic, exported: the codes of the five families; published: one random law, at most 2000
///   states
/// and at rotations and near them, of the analytic methods, the gradient through U Vᵀ alone (of
/// ours: through the return mapping of sand in tension, which is U Vᵀ), with factor_gradient, the
/// largest entry of the gradient through U and V themselves.
Plan spectral_cells(const StabilityOptions& options, const Subjects& subjects);

}  // namespace uniphy::stability
