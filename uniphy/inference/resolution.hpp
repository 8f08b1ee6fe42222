#pragma once

#include <string>
#include <vector>

#include "uniphy/io/observation.hpp"

namespace uniphy {

/// What a fit simulates an observation with, where that is not what the observation says.
struct Resolution {
  int grid = 0;                 ///< nodes a side; 0: those of the observation
  double dt = 0;                ///< s; 0: that of the observation, as much finer as the grid
  double particles_a_cell = 8;  ///< of a body that is filled
};

/// The observation for a simulation of that resolution. A surface is filled with a lattice of
/// particles; so is, on another grid, a cloud (CloudSolid), whose points become tracers. Walls stay
/// where they are. Throws Error, starting with `name`, where that is not possible on the grid, or
/// where the surface cannot be filled; adds to `warnings` what was mended in a surface.
Observation at_resolution(const Observation& seen, const Resolution& resolution,
                          const std::string& name, std::vector<std::string>& warnings);

}  // namespace uniphy
