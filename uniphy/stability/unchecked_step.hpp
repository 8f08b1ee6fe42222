#pragma once

#include <memory>
#include <vector>

#include "uniphy/scene/scene.hpp"

namespace uniphy::stability {

/// The MPM step of kernels::Rollout (rollout.hpp) as it is often written, for comparison: a fixed
/// time step, and nothing checked. A position outside of the grid, or NaN, is put back to the
/// border, where the run goes on with it. mass_epsilon (kg): grid velocities are
/// momentum/(mass + ε) in place of momentum/mass where mass > 0; 0: as in the engine.
/// In float64 on one thread; slow. Where nothing leaves the grid and ε = 0, positions agree with
/// the engine's to rounding.
class UncheckedRollout {
 public:
  UncheckedRollout(const SceneDescription& scene, const PlacedScene& placed, double mass_epsilon);

  void step();
  const ParticleState& state() const { return state_; }

 private:
  void deform();
  void scatter();
  void update_grid();
  void gather();

  kernels::GridSettings grid_;
  double mass_epsilon_;
  std::vector<kernels::BodyRange<double>> bodies_;
  std::vector<double> mass_, volume_;
  ParticleState state_;
  std::vector<double> tau_;    ///< [P, 9] Pa
  std::vector<double> nodes_;  ///< [n³, 4] momentum or velocity, mass
};

}  // namespace uniphy::stability
