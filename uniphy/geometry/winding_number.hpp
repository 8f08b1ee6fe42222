#pragma once

#include <Eigen/Core>
#include <vector>

#include "uniphy/geometry/polygon_mesh.hpp"

namespace uniphy {

/// Generalized winding number of a triangle surface (A. Jacobson et al. 2013): 1/(4π) times the
/// solid angle that the surface covers seen from a point: 1 inside and 0 outside a closed surface
/// that looks outwards, more where parts overlap, 0 in a cavity.
///
/// Far groups of triangles count as one dipole, Σ area·normal · (c − p)/(4π |c − p|³) (G. Barill et
/// al. 2018, "Fast Winding Numbers for Soups and Clouds", first order), so that a query costs
/// O(log triangles). Near ones are exact (A. Van Oosterom and J. Strackee 1983).
class WindingNumber {
 public:
  /// A group is far when the point is more than `accuracy` of its radii away; 2.5 keeps the error
  /// below about 0.03 for closed surfaces.
  explicit WindingNumber(const TriangleMesh& mesh, double accuracy = 2.5);

  double operator()(const Eigen::Vector3d& p) const;
  /// The sum over all triangles, for comparison.
  double exact(const Eigen::Vector3d& p) const;

 private:
  struct Node {
    Eigen::Vector3d centre;       ///< area-weighted mean of the triangles' centroids
    Eigen::Vector3d area_normal;  ///< Σ area · normal, m²
    double radius;                ///< all corners lie within it of the centre
    int first, last;              ///< triangles [first, last)
    int left, right;              ///< children, −1 in a leaf
  };
  struct Triangle {
    Eigen::Vector3d a, b, c;
  };
  static double solid_angle(const Triangle& triangle, const Eigen::Vector3d& p);
  int build(int first, int last);

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
  double accuracy_;
};

/// The inside of a surface, the union of its parts: winding number > ½.
class MeshSolid final : public Solid {
 public:
  explicit MeshSolid(const ClosedSurface& surface);
  bool inside(const Eigen::Vector3d& p) const override;
  Bounds bounds() const override { return bounds_; }
  double volume() const override { return volume_; }

 private:
  WindingNumber winding_;
  Bounds bounds_;
  double volume_;
};

}  // namespace uniphy
