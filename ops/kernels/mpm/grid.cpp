#include "ops/kernels/mpm/grid.hpp"

#include <cmath>
#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {

void GridSettings::check() const {
  // 1024³ nodes in double are 34 GB; beyond that the setting is a mistake.
  if (n < 4 || n > 1024) {
    throw Error("grid: expected 4 to 1024 nodes a side, found " + std::to_string(n));
  }
  if (!(dt > 0) || !std::isfinite(dt)) {
    throw Error("grid: expected a time step dt > 0 s, found " + std::to_string(dt));
  }
  for (const double g : gravity) {
    if (!std::isfinite(g))
      throw Error("grid: expected a finite gravity, found " + std::to_string(g));
  }
  if (bound < 0 || 2 * bound > n) {
    throw Error("grid: expected walls of 0 to n/2 = " + std::to_string(n / 2) +
                " nodes, found bound = " + std::to_string(bound));
  }
}

}  // namespace uniphy::kernels
