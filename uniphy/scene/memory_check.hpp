#pragma once

#include <cstddef>
#include <string>

namespace uniphy {

/// Throws Error `key: ...` with both numbers where the nodes of a grid of n a side take more than
/// all memory and swap of the machine, or than the process may have (ulimit -v). To be called
/// before they are taken.
void check_grid_memory(const std::string& key, int n, std::size_t bytes_of_a_number);

/// The same for the particles of a simulation, all bodies together.
void check_particle_memory(const std::string& key, std::ptrdiff_t particles);

}  // namespace uniphy
