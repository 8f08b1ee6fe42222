#pragma once

#include "uniphy/scene/scene.hpp"
#include "uniphy/stability/planned_cell.hpp"
#include "uniphy/stability/stability_options.hpp"
#include "uniphy/stability/subjects.hpp"

namespace uniphy::stability {

/// The benchmark cube, set on the floor:
///   time_step         Δt = 0.25, 0.5 and 1 × the stable step (time_step.hpp); must hold
///   time_step_beyond  2, 4 and 16 × of it: what a user who gives dt can do. The safety factor of
///                     0.3 lies between it and the limit of the scheme, so that 2 may well hold
///   stiffness         `auto` at the upper ends of the ranges of the families and at 10 × those;
///                     the code of the stiffest training material, and with its stress scale × 10
///   viscosity         `auto`, newtonian and non_newtonian at the upper end and 10, 100, 1000 ×
/// unchecked_step has the steps of the first two rows, and in the others the fixed 5e-4 s of the
/// benchmark scenes of the field.
Plan time_step_cells(const StabilityOptions& options, const Subjects& subjects);

/// The stressors of a scene share this: the plan's cell for a scene by a method, with the hash of
/// all that it depends on.
void add_rollout(Plan& plan, const StabilityOptions& options, const Subjects& subjects,
                 const std::string& stressor, const std::string& method, const std::string& setting,
                 const SceneDescription& scene);

}  // namespace uniphy::stability
