#include "uniphy/scene/memory_check.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/sysinfo.h>

#include <algorithm>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/mpm/grid.hpp"

namespace uniphy {
namespace {

double largest_memory() {
  struct sysinfo machine = {};
  double bytes = std::numeric_limits<double>::infinity();
  if (::sysinfo(&machine) == 0) {
    bytes = (static_cast<double>(machine.totalram) + static_cast<double>(machine.totalswap)) *
            machine.mem_unit;
  }
  rlimit limit = {};
  if (::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    bytes = std::min(bytes, static_cast<double>(limit.rlim_cur));
  }
  return bytes;
}

/// What a particle of a simulation takes at its peak: the difference between 1e6 and 2e6 of them,
/// 1330 in float64 and 1340 in float32.
constexpr double kBytesOfAParticle = 1300;

void check_bytes(const std::string& what, double bytes) {
  const double largest = largest_memory();
  if (bytes <= largest) return;
  throw Error(
      fmt::format("{} take {:.3g} GB, expected at most {:.3g} GB, which is all that there is", what,
                  1e-9 * bytes, 1e-9 * largest));
}

}  // namespace

void check_grid_memory(const std::string& key, int n, std::size_t bytes_of_a_number) {
  check_bytes(fmt::format("{}: {} nodes a side", key, n),
              static_cast<double>(kernels::grid_size(n)) * double(bytes_of_a_number));
}

void check_particle_memory(const std::string& key, std::ptrdiff_t particles) {
  check_bytes(fmt::format("{}: {} particles", key, particles),
              kBytesOfAParticle * static_cast<double>(particles));
}

}  // namespace uniphy
