#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "uniphy/geometry/solid.hpp"

namespace uniphy {

/// The body that a dense cloud of particles with volumes stands for: where its volume fraction,
/// smoothed by quadratic B-splines 1.25 mean spacings wide, is at least a half. On a flat side that
/// is the side of the body, half a spacing beyond its particles; edges are rounded by about half a
/// spacing.
class CloudSolid final : public Solid {
 public:
  /// x in m, volume in m³, one for each. Throws Error where there is none.
  CloudSolid(std::vector<Eigen::Vector3d> x, std::vector<double> volume);

  bool inside(const Eigen::Vector3d& p) const override { return fraction(p) >= 0.5; }
  /// Of the particles, and half a spacing more on every side.
  Bounds bounds() const override { return bounds_; }
  double volume() const override { return total_; }  ///< Σ volume

  double fraction(const Eigen::Vector3d& p) const;

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct CellHash {
    std::size_t operator()(const Cell& cell) const;
  };
  Cell cell_of(const Eigen::Vector3d& p) const;

  std::vector<Eigen::Vector3d> x_;
  std::vector<double> volume_;
  double total_ = 0, width_ = 0;
  Bounds bounds_;
  std::unordered_map<Cell, std::vector<std::int32_t>, CellHash> cells_;  ///< 1.5 widths wide
};

}  // namespace uniphy
