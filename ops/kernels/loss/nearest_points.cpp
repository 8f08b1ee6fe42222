#include "ops/kernels/loss/nearest_points.hpp"

#include <nanoflann.hpp>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {
namespace {

/// What nanoflann asks of a set of points.
struct Points {
  std::vector<double> x;  ///< [count, 3]

  std::size_t kdtree_get_point_count() const { return x.size() / 3; }
  double kdtree_get_pt(std::size_t point, std::size_t k) const { return x[3 * point + k]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Distance = nanoflann::L2_Simple_Adaptor<double, Points, double, std::uint32_t>;
using Index = nanoflann::KDTreeSingleIndexAdaptor<Distance, Points, 3, std::uint32_t>;

}  // namespace

struct NearestPoints::Tree {
  Points points;
  Index index{3, points};
};

NearestPoints::NearestPoints(const double* points, std::size_t count)
    : tree_(new Tree{{{points, points + 3 * count}}}) {}
NearestPoints::~NearestPoints() = default;
NearestPoints::NearestPoints(NearestPoints&&) noexcept = default;
NearestPoints& NearestPoints::operator=(NearestPoints&&) noexcept = default;

std::int64_t NearestPoints::nearest(const double* at) const {
  std::uint32_t row = 0;
  double square = 0;
  if (tree_->index.knnSearch(at, 1, &row, &square) == 0)
    throw Error("NearestPoints: expected at least one point, found none");
  return row;
}

}  // namespace uniphy::kernels
