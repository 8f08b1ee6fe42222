#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "uniphy/inference/fit.hpp"

namespace uniphy {
namespace {

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double square = 0;
  for (std::size_t k = 0; k < a.size(); ++k) square += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(square);
}

}  // namespace

std::ptrdiff_t horizon_frames(double horizon, std::ptrdiff_t contact, std::ptrdiff_t frames) {
  const std::ptrdiff_t from = contact < frames ? contact : 0;
  const auto more =
      static_cast<std::ptrdiff_t>(std::ceil(horizon * static_cast<double>(frames - from) - 1e-9));
  return std::clamp<std::ptrdiff_t>(from + more, 2, frames);
}

std::vector<int> choose_starts(const FitVariables& variables, const std::vector<double>& loss_short,
                               const std::vector<double>& loss_full, int count) {
  std::vector<int> order;
  for (int i = 0; i < variables.starts(); ++i) {
    if (std::isfinite(loss_short[i])) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return loss_short[a] < loss_short[b]; });
  std::vector<int> chosen;
  const auto add = [&](int i) {
    if (static_cast<int>(chosen.size()) < count &&
        std::find(chosen.begin(), chosen.end(), i) == chosen.end()) {
      chosen.push_back(i);
    }
  };
  if (order.empty()) return chosen;

  add(order.front());
  const int full =
      static_cast<int>(std::min_element(loss_full.begin(), loss_full.end()) - loss_full.begin());
  if (std::isfinite(loss_full[full])) add(full);
  std::set<std::string> seen;
  for (const int i : order) {
    if (seen.insert(variables.label(i)).second) add(i);
  }
  // The rest: in order of loss, at a distance from those chosen that shrinks until enough are
  // found.
  for (double least = 1; static_cast<int>(chosen.size()) < count; least *= 0.5) {
    if (least < 1e-3) least = 0;
    for (const int i : order) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const int j : chosen) {
        nearest = std::min(nearest, distance(variables.start(i), variables.start(j)));
      }
      if (nearest >= least) add(i);
    }
    if (least == 0) break;
  }
  return chosen;
}

}  // namespace uniphy
