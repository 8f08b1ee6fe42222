#pragma once

#include <exception>

namespace uniphy {

/// visit(i) for every i < count on all threads; roll-outs inside then use one thread each. Throws
/// one of the exceptions of the visits after all of them have ended.
template <class Visit>
void for_each(int count, const Visit& visit) {
  if (count == 1) {  // the roll-out itself uses the threads
    visit(0);
    return;
  }
  std::exception_ptr failure;
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < count; ++i) {
    try {
      visit(i);
    } catch (...) {
#pragma omp critical(uniphy_fit_failure)
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace uniphy
