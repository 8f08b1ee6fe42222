#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "ops/kernels/base/for_each.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {

/// kernels::for_each with a Progress: work(i) for every i < count, of which `before` were done
/// earlier. An interrupt is seen between two calls.
template <class Work>
void for_each_with_progress(const std::string& label, const std::string& unit, std::int64_t count,
                            const Work& work, std::int64_t before = 0) {
  Progress progress(label, before + count, unit);
  std::int64_t done = before;
  std::mutex guard;
  kernels::for_each(count, [&](std::ptrdiff_t i) {
    work(i);
    const std::lock_guard<std::mutex> lock(guard);
    progress.update(++done);
  });
}

}  // namespace uniphy
