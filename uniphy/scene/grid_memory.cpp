#include "uniphy/scene/grid_memory.hpp"

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

}  // namespace

void check_grid_memory(const std::string& key, int n, std::size_t bytes_of_a_number) {
  const double bytes = static_cast<double>(kernels::grid_size(n)) * double(bytes_of_a_number);
  const double largest = largest_memory();
  if (bytes <= largest) return;
  throw Error(
      fmt::format("{}: {} nodes a side take {:.3g} GB, expected at most {:.3g} GB, which is "
                  "all that there is",
                  key, n, 1e-9 * bytes, 1e-9 * largest));
}

}  // namespace uniphy
