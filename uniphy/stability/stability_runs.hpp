#pragma once

#include "uniphy/scene/scene.hpp"
#include "uniphy/stability/stability_cell.hpp"

namespace uniphy::stability {

/// Steps between two looks at a state: a violation is dated to within so many.
inline constexpr std::int64_t kLookEvery = 10;

/// ε of the method mass_epsilon, kg, added to the mass of every node: a millionth of the mass of a
/// particle of the benchmark cube (0.125 kg), of the size that such terms have. It takes 4e-4 of
/// the momentum of a smaller cube of such particles in 300 steps (light_body).
inline constexpr double kMassEpsilon = 1e-7;

/// Rolls the scene out with the engine and judges it by RunWatch. An Error of the engine or of the
/// placement ends the cell as `stops`, with the particle and the step that LostParticle carries.
/// Sets the numbers of RunWatch, dt (s), steps (done) and warnings (scene_warnings.hpp), which are
/// told in the cause of a failure.
/// Where not null, *last receives the final state of a run that reached its end, else is emptied.
void run_checked(SceneDescription scene, Cell& cell, ParticleState* last = nullptr);

/// The same scene by the unchecked step (unchecked_step.hpp), at the scene's dt.
void run_unchecked(const SceneDescription& scene, double mass_epsilon, Cell& cell,
                   ParticleState* last = nullptr);

}  // namespace uniphy::stability
