#pragma once

#include <vector>

#include "uniphy/geometry/signed_distance.hpp"

namespace uniphy {

/// Convex hull of a few points round the origin. Exact: inside, the nearest face plane; outside,
/// the nearest face, edge or corner.
class ConvexPolyhedron : public SignedDistance {
 public:
  double distance(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return bounds_; }
  double volume() const override;  ///< Σ area · distance of the face from the origin / 3

 protected:
  /// The faces are found by trying each triple of points: for solids of a few dozen corners.
  explicit ConvexPolyhedron(const std::vector<Eigen::Vector3d>& corners);

 private:
  struct Face {
    Eigen::Vector3d normal;                ///< unit, outwards
    double offset = 0;                     ///< normal · x on the face
    std::vector<Eigen::Vector3d> corners;  ///< counterclockwise seen from outside
  };
  static double face_distance(const Face& face, const Eigen::Vector3d& p);

  std::vector<Face> faces_;
  Bounds bounds_;
};

}  // namespace uniphy
