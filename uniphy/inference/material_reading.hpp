#pragma once

#include <limits>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"

namespace uniphy {

/// What a law is made of, read off its answers alone, whatever its form: SI units, NaN where the
/// material has no such number.
struct MaterialReading {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  /// elastic, newtonian (any fluid: sand with a friction below 0.005 rad is one), plasticine
  /// (yields, and all that exceeds flows off within a step), sand (bears no shear without pressure)
  /// or non_newtonian (yields, and flows at a rate). A body that did not yield at the strains that
  /// it saw is called elastic.
  std::string material;
  double mu = kNone;      ///< Pa, of small shear, from slight compressions to none
  double lambda = kNone;  ///< Pa; of a fluid its bulk modulus
  double young = kNone, poisson = kNone;
  double yield_stress = kNone;    ///< Pa, the norm of the deviator of τ without pressure
  double friction_angle = kNone;  ///< rad, of a cone of Drucker and Prager that touches it
  double cohesion = kNone;        ///< Pa, of the same cone: what sand bears without pressure
  double viscosity = kNone;  ///< Pa s, of a fluid dτ/dγ̇ in shear; of a non-Newtonian body η
  double strain_seen = 0;    ///< largest norm of the deviator of log Σ that counted
};

/// Probes the law at a time step: small strains, then shear up to `strain_seen` (the norm of the
/// deviator of log Σ) at pressures down to none, then a rate of shear. A solid that yields, but of
/// whose excess over that next to nothing flows off within `duration` (s, what was observed), is
/// called elastic.
MaterialReading read_material(const kernels::LawDescription& law, double dt, double strain_seen,
                              double duration = std::numeric_limits<double>::infinity());

/// The norm of the deviator of log Σ that all but the last per mille of the deformation gradients
/// F [count, 9] stay below.
double strain_seen(const std::vector<double>& F);

/// A number of a reading: its key in metrics, its name for people and its unit.
struct ReadingNumber {
  const char *key, *name, *unit;
  double MaterialReading::*value;
};
const std::vector<ReadingNumber>& reading_numbers();

}  // namespace uniphy
