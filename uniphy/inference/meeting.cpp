#include "uniphy/inference/meeting.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace uniphy {
namespace {

/// The nodes that the particles of a frame reach.
class Nodes {
 public:
  explicit Nodes(const kernels::GridSettings& grid)
      : n_(grid.n), reached_(static_cast<std::size_t>(n_) * n_ * n_) {}

  void clear() { std::fill(reached_.begin(), reached_.end(), false); }
  void reach(const double* x) {
    visit(x, [&](std::size_t node) {
      reached_[node] = true;
      return false;
    });
  }
  bool reached_by(const double* x) const {
    return visit(x, [&](std::size_t node) { return bool(reached_[node]); });
  }

 private:
  /// The quadratic B-spline of a particle at x reaches the nodes less than 1.5 cells away.
  template <class Node>
  bool visit(const double* x, const Node& node) const {
    std::array<int, 3> low{}, high{};
    for (int k = 0; k < 3; ++k) {
      const double cell = x[k] * n_;
      low[k] = std::clamp(static_cast<int>(std::ceil(cell - 1.5)), 0, n_ - 1);
      high[k] = std::clamp(static_cast<int>(std::floor(cell + 1.5)), 0, n_ - 1);
    }
    for (int i = low[0]; i <= high[0]; ++i) {
      for (int j = low[1]; j <= high[1]; ++j) {
        for (int k = low[2]; k <= high[2]; ++k) {
          if (node((static_cast<std::size_t>(i) * n_ + j) * n_ + k)) return true;
        }
      }
    }
    return false;
  }

  int n_;
  std::vector<bool> reached_;
};

}  // namespace

std::int64_t first_meeting(const BodyPath& a, const BodyPath& b,
                           const kernels::GridSettings& grid) {
  const std::int64_t frames = std::min(a.frames, b.frames);
  if (frames == 0) return -1;
  const std::int64_t of_a = static_cast<std::int64_t>(a.x.size()) / a.frames,
                     of_b = static_cast<std::int64_t>(b.x.size()) / b.frames;
  Nodes nodes(grid);
  for (std::int64_t f = 0; f < frames; ++f) {
    nodes.clear();
    for (std::int64_t k = 0; k < of_a; k += 3) {
      const double* x = a.x.data() + f * of_a + k;
      if (!std::isnan(x[0])) nodes.reach(x);
    }
    for (std::int64_t k = 0; k < of_b; k += 3) {
      const double* x = b.x.data() + f * of_b + k;
      if (!std::isnan(x[0]) && nodes.reached_by(x)) return f;
    }
  }
  return -1;
}

std::vector<int> meeting_groups(const std::vector<std::vector<bool>>& meets) {
  std::vector<int> group(meets.size(), -1);
  int groups = 0;
  for (std::size_t b = 0; b < meets.size(); ++b) {
    if (group[b] >= 0) continue;
    std::vector<std::size_t> todo{b};
    while (!todo.empty()) {
      const std::size_t at = todo.back();
      todo.pop_back();
      if (group[at] >= 0) continue;
      group[at] = groups;
      for (std::size_t other = 0; other < meets.size(); ++other) {
        if (meets[at][other]) todo.push_back(other);
      }
    }
    ++groups;
  }
  return group;
}

}  // namespace uniphy
