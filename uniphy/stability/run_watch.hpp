#pragma once

#include <cstdint>

#include "uniphy/scene/scene.hpp"
#include "uniphy/stability/stability_cell.hpp"

namespace uniphy::stability {

/// The energy of a roll-out may grow by this share of what it began with. A motion under gravity
/// between walls that do no work, from an undeformed state, has at any later time
///   kinetic + potential  =  initial kinetic + potential − stored (≥ 0) − dissipated (≥ 0),
/// so that any growth is an error. Explicit steps may bring a little, which what the transfer
/// dissipates hides: every analytic run of the matrix at `auto` comes to 0, what fails to 0.05 and
/// more, soon to 1e2 … 1e7.
inline constexpr double kEnergyTolerance = 0.05;

/// Looks at the states of one roll-out and keeps the first violation of the criteria of Verdict.
///   kinetic energy    Σ ½ m (|v|² + (Δx²/4) ‖C‖²) J, that of an APIC particle
///   potential energy  −Σ m g·x J, counted from the wall that gravity points at
///   growth            (energy − initial)/initial, the largest so far
class RunWatch {
 public:
  explicit RunWatch(const PlacedScene& placed);

  /// State after `step` steps; x, v [P, 3], C, F [P, 9]. Returns false once something is violated.
  bool look(std::int64_t step, const ParticleState& state);

  bool violated() const { return violated_; }
  const Failure& failure() const { return failure_; }
  double growth() const { return growth_; }
  double least_volume() const { return least_volume_; }  ///< det F
  double kept() const { return kept_; }                  ///< energy over initial, last state
  double speed() const { return speed_; }                ///< m/s, the largest so far

  /// The numbers above by name, verdict (holds or fails) and failure.
  void report(Cell& cell) const;

 private:
  double energy(const ParticleState& state) const;
  void violate(std::int64_t step, std::int64_t particle, const std::string& cause);

  const PlacedScene& placed_;
  double floor_[3];
  double initial_ = 0, growth_ = 0, least_volume_ = 1, kept_ = 1, speed_ = 0;
  bool begun_ = false, violated_ = false;
  Failure failure_;
};

}  // namespace uniphy::stability
