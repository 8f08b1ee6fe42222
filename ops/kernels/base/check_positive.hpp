#pragma once

#include <cmath>
#include <cstddef>
#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {

/// Throws Error unless the numbers of the particles [begin, end) are finite and positive: masses
/// and volumes, which steps and their adjoints divide by.
template <class T>
void check_positive(const char* where, const char* name, const T* values, std::ptrdiff_t begin,
                    std::ptrdiff_t end) {
  for (std::ptrdiff_t p = begin; p < end; ++p) {
    if (values[p] > 0 && std::isfinite(values[p])) continue;
    throw Error(std::string(where) + ": expected a positive " + name + " of particle " +
                std::to_string(p) + ", found " + std::to_string(values[p]));
  }
}

}  // namespace uniphy::kernels
