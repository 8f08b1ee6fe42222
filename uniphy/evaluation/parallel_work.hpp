#pragma once

#include <cstdint>
#include <exception>
#include <string>

#include "uniphy/report/progress.hpp"

namespace uniphy {

/// work(i) for i = 0 … total − 1, one a thread, with progress. Each call must write to its own
/// place alone, so that the result has the same bits on any number of threads. The first exception
/// ends the loop and is thrown again; an interrupt is seen between two calls.
template <class Work>
void parallel_work(const std::string& label, const std::string& unit, std::int64_t total,
                   const Work& work) {
  Progress progress(label, total, unit);
  std::exception_ptr failure;
  std::int64_t done = 0;
#pragma omp parallel for schedule(dynamic, 1)
  for (std::int64_t i = 0; i < total; ++i) {
    bool stop;
#pragma omp critical(uniphy_parallel_work)
    stop = failure != nullptr;
    if (stop) continue;
    try {
      work(i);
      std::exception_ptr thrown;  // must not leave the critical section
#pragma omp critical(uniphy_parallel_work)
      try {
        progress.update(++done);
      } catch (...) {
        thrown = std::current_exception();
      }
      if (thrown) std::rethrow_exception(thrown);
    } catch (...) {
#pragma omp critical(uniphy_parallel_work)
      if (!failure) failure = std::current_exception();
    }
  }
  progress.finish();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace uniphy
