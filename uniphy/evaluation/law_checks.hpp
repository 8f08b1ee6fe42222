#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/mpm/grid.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// The largest relative error of a law whose input is turned, F → Q F and C → Q C Qᵀ, over many
/// states; both parts in float64.
struct FrameIndifference {
  /// ‖τ(QF, QCQᵀ) − Q τ(F, C) Qᵀ‖ / max(‖τ‖, 1e-2 of the trajectory's RMS ‖τ‖). The floor is for
  /// states at rest: QF is rounded, which changes its strain by 1e-16, and a stiff law shows that
  /// against a stress of next to nothing.
  double stress = 0;
  /// ‖b(QF) − Q b(F) Qᵀ‖ / ‖b‖ of b = F_proj F_projᵀ, the left Cauchy–Green tensor. F_proj itself
  /// is not compared: a law is free in the rotation that it leaves to the right of its stretch (the
  /// analytic fluid forgets it, F_proj = J^{1/3} I), and no stress or motion can tell. Of a fluid
  /// b is all that a rotation of F leaves to compare.
  double projection = 0;

  /// The larger of two numbers each; NaN where one of them is.
  void include(const FrameIndifference& other);
};

/// Over all states of the data set, each trajectory with its law (laws[i]) and every state with a
/// rotation of its own, drawn from the seed.
FrameIndifference frame_indifference(const Dataset& data,
                                     const std::vector<kernels::LawDescription>& laws,
                                     std::uint64_t seed);

/// A body that is left alone.
struct RestOptions {
  kernels::GridSettings grid;  ///< its gravity is not used
  double dt = 1.0 / 4800;      ///< s, lowered where the law's own stiffness asks for it
  std::int64_t steps = 1000;
  std::int64_t particles = 200;  ///< about so many in a sphere of 0.3 m in the middle
  double density = 1000;         ///< kg/m³
};

/// The largest distance (m) that any particle of the body moved from its place in any step, without
/// gravity, for each law. A run that fails counts as 1 m, the side of the domain, and the reason
/// goes to stderr.
std::vector<double> rest_drifts(const std::vector<kernels::LawDescription>& laws,
                                const RestOptions& options);

}  // namespace uniphy
