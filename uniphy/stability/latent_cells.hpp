#pragma once

#include "uniphy/stability/planned_cell.hpp"
#include "uniphy/stability/stability_options.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {

/// Laws off the training set, on the benchmark cube at `auto`, each drawn `drawn` times:
///   codes_interpolated  half way between two training codes
///   codes_extrapolated  1.5 and 2 × a training code
///   codes_random        every coordinate normal with variance 1
///   weights_perturbed   every weight and bias w (1 + s n), n normal, s = 0.01, 0.1, 0.3, 1
///   weak_network        random networks of the published form, and the same by unchecked_step with
///                       the field's fixed 5e-4 s
///   dissipation         without a roll-out: work of plastic flow and of viscosity, dissipation.hpp
Plan latent_cells(const StabilityOptions& options, const Subjects& subjects);

}  // namespace uniphy::stability
