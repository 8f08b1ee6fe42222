#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace uniphy::testing {

/// Central differences of fourth order: error O(h⁴) + O(eps |f| / h). h[i] is the step of x[i].
template <class Function>
std::vector<double> central_differences(const Function& f, std::vector<double> x,
                                        const std::vector<double>& h) {
  std::vector<double> gradient(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double at = x[i];
    const auto value = [&](double steps) {
      x[i] = at + steps * h[i];
      return f(x);
    };
    gradient[i] = (8 * (value(1) - value(-1)) - (value(2) - value(-2))) / (12 * h[i]);
    x[i] = at;
  }
  return gradient;
}

/// ‖a − b‖/‖b‖; the absolute error where the reference is zero.
inline double relative_error(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return std::sqrt(difference) / (size > 0 ? std::sqrt(size) : 1);
}

}  // namespace uniphy::testing
