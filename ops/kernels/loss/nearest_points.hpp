#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace uniphy::kernels {

/// A k-d tree over points [count, 3], all of them finite, which are copied.
class NearestPoints {
 public:
  NearestPoints(const double* points, std::size_t count);
  ~NearestPoints();
  NearestPoints(NearestPoints&&) noexcept;
  NearestPoints& operator=(NearestPoints&&) noexcept;

  /// Row of the point nearest to at [3]; of several, always the same one. Throws Error where there
  /// is no point.
  std::int64_t nearest(const double* at) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace uniphy::kernels
