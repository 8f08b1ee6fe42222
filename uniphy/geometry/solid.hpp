#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

namespace uniphy {

/// Axis-aligned box, m.
struct Bounds {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();

  Eigen::Vector3d centre() const { return 0.5 * (min + max); }
  Eigen::Vector3d sides() const { return max - min; }
  double largest_side() const { return sides().maxCoeff(); }
};

/// A body in its own frame: what is needed to fill it with particles. Immutable, so one instance
/// serves several threads.
class Solid {
 public:
  virtual ~Solid() = default;
  /// Whether the point (m, own frame) belongs to the body.
  virtual bool inside(const Eigen::Vector3d& p) const = 0;
  /// A box that holds the body and touches it on every side (to 1e-3 of its largest side where the
  /// shape says so).
  virtual Bounds bounds() const = 0;
  /// m³.
  virtual double volume() const = 0;
};

using SolidPtr = std::shared_ptr<const Solid>;

}  // namespace uniphy
