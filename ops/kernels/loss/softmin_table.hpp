#pragma once

#include <cstddef>

#include "ops/kernels/simd/dispatch.hpp"

// The sums over all pairs of two sets of points that entropic optimal transport is made of. Points
// x_i of `rows` and y_j of `columns`, weights b_j, cost C_ij = ½ |x_i − y_j|², potentials g_j (m²)
// and the temperature ε (m²):
//   softmin       F_i = −ε log Σ_j b_j exp((g_j − C_ij)/ε)
//   plan          π_ij = b_j exp((g_j − C_ij + F_i)/ε), Σ_j π_ij = 1
//   barycentres   T_i = Σ_j π_ij y_j
// and their adjoints, with the plans computed again:
//   dF_i = Σ_j π_ij (dC_ij − dg_j)
//   dT_i = Σ_j π_ij (dy_j + (y_j − T_i) (dg_j − dC_ij)/ε)
// No matrix of all pairs is kept. One row after the other, a vector of columns at a time, so that
// the bits depend on nothing but the instruction set.

namespace uniphy::kernels {

/// Columns are padded to a multiple of this, the widest vector of doubles.
inline constexpr std::ptrdiff_t kColumnPadding = 8;
constexpr std::ptrdiff_t padded_columns(std::ptrdiff_t count) {
  return (count + kColumnPadding - 1) / kColumnPadding * kColumnPadding;
}

/// Points in planes of `padded` numbers, near the origin (|x|²/ε is rounded as a number of its
/// size). Borrowed.
struct WeightedPoints {
  const double* x;            ///< [3, padded] m; 0 beyond the points
  const double* log_weights;  ///< [padded] log₂ b; kNoWeight beyond the points
  std::ptrdiff_t count, padded;
};
inline constexpr double kNoWeight = -1e30;

/// The inner loops on one instruction set. What has a number for each point has `padded` of them
/// (columns) or three planes of `padded`; `scratch` is [5, padded] of the columns. Gradients are
/// added to what is there; those by positions may be null: not wanted.
struct SoftminTable {
  /// → softmin F of each row.
  void (*softmin)(const WeightedPoints& rows, const WeightedPoints& columns,
                  const double* potentials, double epsilon, double* scratch, double* softmin);
  /// Given F and dL/dF.
  void (*softmin_adjoint)(const WeightedPoints& rows, const WeightedPoints& columns,
                          const double* potentials, double epsilon, double* scratch,
                          const double* softmin, const double* grad_softmin, double* grad_rows,
                          double* grad_columns, double* grad_potentials);
  /// → barycentres T (three planes) and softmin F of each row.
  void (*barycentres)(const WeightedPoints& rows, const WeightedPoints& columns,
                      const double* potentials, double epsilon, double* scratch, double* softmin,
                      double* barycentres);
  /// Given F, T and dL/dT.
  void (*barycentres_adjoint)(const WeightedPoints& rows, const WeightedPoints& columns,
                              const double* potentials, double epsilon, double* scratch,
                              const double* softmin, const double* barycentres,
                              const double* grad_barycentres, double* grad_rows,
                              double* grad_columns, double* grad_potentials);
};

UNIPHY_ISA_TABLE(SoftminTable)

}  // namespace uniphy::kernels
