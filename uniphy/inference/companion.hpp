#pragma once

#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "uniphy/inference/initial_state.hpp"

namespace uniphy {

/// Another body of the scene, which a roll-out moves along with the one that is fitted.
struct Companion {
  std::vector<double> x;       ///< [particles, 3] m, at the first frame
  std::vector<double> volume;  ///< [particles] m³ at rest
  double density = 1000;       ///< kg/m³
  kernels::LawDescription law;
  InitialState motion;  ///< at the first frame
};

}  // namespace uniphy
