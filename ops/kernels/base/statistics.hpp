#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace uniphy::kernels {

/// The value at position ⌊share · (n − 1)⌋ of the n sorted values: a value of the list, never
/// between two of them. NaN of none; the values must be comparable (no NaN).
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The middle value, or the mean of the middle two where their number is even. NaN of none.
inline double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// Σ a², over `count` numbers.
inline double sum_of_squares(const double* a, std::ptrdiff_t count) {
  double sum = 0;
  for (std::ptrdiff_t k = 0; k < count; ++k) sum += a[k] * a[k];
  return sum;
}

/// Σ (a − b)², over `count` numbers.
inline double squared_distance(const double* a, const double* b, std::ptrdiff_t count) {
  double sum = 0;
  for (std::ptrdiff_t k = 0; k < count; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

}  // namespace uniphy::kernels
