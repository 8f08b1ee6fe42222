#pragma once

#include <cstddef>
#include <exception>
#include <mutex>

namespace uniphy::kernels {

/// visit(i) for every i < count on all threads, handed out in order, one at a time; a parallel loop
/// inside of a visit then runs on one thread. A single visit runs on the calling thread and may use
/// all of them. Each visit must write to its own place alone, so that the result has the same bits
/// on any number of threads.
///
/// An exception ends the loop: visits before it still run, those after it do not begin. Of several
/// the one of the smallest i is thrown again, which is the one that a plain loop would throw.
template <class Visit>
void for_each(std::ptrdiff_t count, const Visit& visit) {
  if (count == 1) {
    visit(std::ptrdiff_t{0});
    return;
  }
  std::mutex guard;
  std::exception_ptr failure;
  std::ptrdiff_t failed = count;
#pragma omp parallel for schedule(dynamic, 1)
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    {
      const std::lock_guard<std::mutex> lock(guard);
      if (i > failed) continue;
    }
    try {
      visit(i);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(guard);
      if (i < failed) {
        failed = i;
        failure = std::current_exception();
      }
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace uniphy::kernels
