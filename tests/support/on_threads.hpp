#pragma once

#include <omp.h>

namespace uniphy::testing {

/// f() on `threads` threads of OpenMP; afterwards there are as many as before.
template <class Function>
auto on_threads(int threads, const Function& f) {
  struct Restore {
    int before = omp_get_max_threads();
    ~Restore() { omp_set_num_threads(before); }
  } restore;
  omp_set_num_threads(threads);
  return f();
}

}  // namespace uniphy::testing
