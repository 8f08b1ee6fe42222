#pragma once

#include "ops/kernels/loss/softmin_table.hpp"
#include "ops/kernels/simd/exp2_lanes.hpp"

// The sums of softmin_table.hpp. With s = log₂e/ε and h_j = log₂ b_j + s (g_j − ½|y_j|²) a plan is
//   π_ij = 2^(h_j + s x_i·y_j − L_i), L_i = s (½|x_i|² − F_i)
// which is three products a pair.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace softmin_detail {

using V = Lanes<double>;
inline constexpr std::ptrdiff_t kWidth = width_of<V>;
static_assert(kColumnPadding % kWidth == 0);
inline constexpr double kLog2E = 1.44269504088896340736;

UNIPHY_INLINE V load(const double* at) {
  return load_lanes<V, double>({at, 1, 0}, 0, 0, kWidth, 0.0);
}
UNIPHY_INLINE void store(double* at, const V& value) {
  store_lanes<V, double>({at, 1, 0}, 0, 0, kWidth, value);
}
UNIPHY_INLINE void add(double* at, const V& a, const V& b) { store(at, lane_fma(a, b, load(at))); }
UNIPHY_INLINE double lane_maximum(const V& a) {
  double lanes[kWidth];
  store(lanes, a);
  double largest = lanes[0];
  for (std::ptrdiff_t l = 1; l < kWidth; ++l) largest = lanes[l] > largest ? lanes[l] : largest;
  return largest;
}

/// Three coordinates in lanes: those of a vector of columns, or one row's in all lanes.
struct Coordinates {
  V x, y, z;
};
UNIPHY_INLINE V dot(const Coordinates& a, const Coordinates& b, const V& c) {
  return lane_fma(a.x, b.x, lane_fma(a.y, b.y, lane_fma(a.z, b.z, c)));
}
UNIPHY_INLINE Coordinates planes_at(const double* planes, std::ptrdiff_t padded, std::ptrdiff_t j) {
  return {load(planes + j), load(planes + padded + j), load(planes + 2 * padded + j)};
}
UNIPHY_INLINE Coordinates row_at(const double* planes, std::ptrdiff_t padded, std::ptrdiff_t i,
                                 double factor) {
  return {V(factor * planes[i]), V(factor * planes[padded + i]),
          V(factor * planes[2 * padded + i])};
}
UNIPHY_INLINE double half_square(const WeightedPoints& p, std::ptrdiff_t i) {
  const double x = p.x[i], y = p.x[p.padded + i], z = p.x[2 * p.padded + i];
  return 0.5 * (x * x + y * y + z * z);
}

/// h_j of the columns.
inline void column_exponents(const WeightedPoints& columns, const double* potentials, double s,
                             double* h) {
  for (std::ptrdiff_t j = 0; j < columns.padded; ++j)
    h[j] = columns.log_weights[j] + s * (potentials[j] - half_square(columns, j));
}

/// max_j of h_j + s x_i·y_j.
UNIPHY_INLINE double largest_exponent(const WeightedPoints& columns, const double* h,
                                      const Coordinates& row) {
  V largest(kNoWeight);
  for (std::ptrdiff_t j = 0; j < columns.padded; j += kWidth) {
    const Coordinates y = planes_at(columns.x, columns.padded, j);
    largest = lane_max(largest, dot(row, y, load(h + j)));
  }
  return lane_maximum(largest);
}

/// The softmin of every row and, where wanted, the mean of the columns by its plan.
template <bool means>
inline void softmin_rows(const WeightedPoints& rows, const WeightedPoints& columns, double s,
                         const double* h, double* softmin, double* barycentres) {
  for (std::ptrdiff_t i = 0; i < rows.count; ++i) {
    const Coordinates row = row_at(rows.x, rows.padded, i, s);
    const double largest = largest_exponent(columns, h, row);
    V sum(0.0);
    Coordinates mean{V(0.0), V(0.0), V(0.0)};
    for (std::ptrdiff_t j = 0; j < columns.padded; j += kWidth) {
      const Coordinates y = planes_at(columns.x, columns.padded, j);
      const V u = exp2_lanes(V(dot(row, y, load(h + j)) - V(largest)));
      sum = sum + u;
      if constexpr (means)
        mean = {lane_fma(u, y.x, mean.x), lane_fma(u, y.y, mean.y), lane_fma(u, y.z, mean.z)};
    }
    const double total = quick_lane_sum(sum);
    softmin[i] = half_square(rows, i) - (largest + std::log2(total)) / s;
    if constexpr (means) {
      barycentres[i] = quick_lane_sum(mean.x) / total;
      barycentres[rows.padded + i] = quick_lane_sum(mean.y) / total;
      barycentres[2 * rows.padded + i] = quick_lane_sum(mean.z) / total;
    }
  }
}

/// What the columns receive from all rows: sums of u_ij and of u_ij x_i + π_ij q_i.
struct ColumnSums {
  double* share;     ///< [padded]
  double* position;  ///< [3, padded]; null: not wanted
};
inline ColumnSums empty_column_sums(double* scratch, std::ptrdiff_t padded, bool positions) {
  for (std::ptrdiff_t k = 0; k < (positions ? 4 : 1) * padded; ++k) scratch[k] = 0;
  return {scratch, positions ? scratch + padded : nullptr};
}
/// Potentials take sign · Σ_i u_ij, positions sign · Σ_i u_ij (x_i − y_j) + Σ_i π_ij q_i.
inline void add_column_sums(const WeightedPoints& columns, const ColumnSums& sums, double sign,
                            double* grad_columns, double* grad_potentials) {
  const std::ptrdiff_t padded = columns.padded;
  for (std::ptrdiff_t j = 0; j < columns.count; ++j) {
    grad_potentials[j] += sign * sums.share[j];
    for (int k = 0; grad_columns && k < 3; ++k) {
      const std::ptrdiff_t at = k * padded + j;
      grad_columns[at] += sums.position[at] - sign * sums.share[j] * columns.x[at];
    }
  }
}

template <bool positions>
inline void softmin_adjoint_rows(const WeightedPoints& rows, const WeightedPoints& columns,
                                 double s, const double* h, const double* softmin,
                                 const double* grad_softmin, double* grad_rows,
                                 const ColumnSums& sums) {
  const std::ptrdiff_t padded = columns.padded;
  for (std::ptrdiff_t i = 0; i < rows.count; ++i) {
    const Coordinates scaled = row_at(rows.x, rows.padded, i, s);
    const Coordinates minus_x = row_at(rows.x, rows.padded, i, -1);
    const V log_sum(s * (half_square(rows, i) - softmin[i])), grad(grad_softmin[i]);
    Coordinates mean{V(0.0), V(0.0), V(0.0)};
    for (std::ptrdiff_t j = 0; j < padded; j += kWidth) {
      const Coordinates y = planes_at(columns.x, padded, j);
      const V u = grad * exp2_lanes(V(dot(scaled, y, load(h + j)) - log_sum));
      mean = {lane_fma(u, y.x, mean.x), lane_fma(u, y.y, mean.y), lane_fma(u, y.z, mean.z)};
      store(sums.share + j, load(sums.share + j) + u);
      if constexpr (positions) {
        add(sums.position + j, u, minus_x.x);
        add(sums.position + padded + j, u, minus_x.y);
        add(sums.position + 2 * padded + j, u, minus_x.z);
      }
    }
    if (!grad_rows) continue;
    const double of_mean[3] = {quick_lane_sum(mean.x), quick_lane_sum(mean.y),
                               quick_lane_sum(mean.z)};
    for (int k = 0; k < 3; ++k) {
      const std::ptrdiff_t at = k * rows.padded + i;
      grad_rows[at] += grad_softmin[i] * rows.x[at] - of_mean[k];
    }
  }
}

template <bool positions>
inline void barycentres_adjoint_rows(const WeightedPoints& rows, const WeightedPoints& columns,
                                     double s, const double* h, const double* softmin,
                                     const double* barycentres, const double* grad_barycentres,
                                     double* grad_rows, const ColumnSums& sums) {
  const std::ptrdiff_t padded = columns.padded;
  const double inverse_epsilon = s / kLog2E;
  for (std::ptrdiff_t i = 0; i < rows.count; ++i) {
    const Coordinates scaled = row_at(rows.x, rows.padded, i, s);
    const Coordinates x = row_at(rows.x, rows.padded, i, 1);
    const Coordinates q = row_at(grad_barycentres, rows.padded, i, 1);
    const Coordinates q_scaled = row_at(grad_barycentres, rows.padded, i, inverse_epsilon);
    const Coordinates minus_mean = row_at(barycentres, rows.padded, i, -1);
    const V log_sum(s * (half_square(rows, i) - softmin[i]));
    const V offset = dot(q_scaled, minus_mean, V(0.0));
    Coordinates force{V(0.0), V(0.0), V(0.0)};
    for (std::ptrdiff_t j = 0; j < padded; j += kWidth) {
      const Coordinates y = planes_at(columns.x, padded, j);
      const V plan = exp2_lanes(V(dot(scaled, y, load(h + j)) - log_sum));
      const V u = plan * dot(q_scaled, y, offset);
      force = {lane_fma(u, y.x, force.x), lane_fma(u, y.y, force.y), lane_fma(u, y.z, force.z)};
      store(sums.share + j, load(sums.share + j) + u);
      if constexpr (positions) {
        add(sums.position + j, u, x.x);
        add(sums.position + padded + j, u, x.y);
        add(sums.position + 2 * padded + j, u, x.z);
        add(sums.position + j, plan, q.x);
        add(sums.position + padded + j, plan, q.y);
        add(sums.position + 2 * padded + j, plan, q.z);
      }
    }
    // Σ_j u_ij = 0, so that Σ_j u_ij (y_j − x_i) is the force alone.
    grad_rows[i] += quick_lane_sum(force.x);
    grad_rows[rows.padded + i] += quick_lane_sum(force.y);
    grad_rows[2 * rows.padded + i] += quick_lane_sum(force.z);
  }
}

}  // namespace softmin_detail

inline void softmin(const WeightedPoints& rows, const WeightedPoints& columns,
                    const double* potentials, double epsilon, double* scratch, double* softmin) {
  using namespace softmin_detail;
  const double s = kLog2E / epsilon;
  column_exponents(columns, potentials, s, scratch);
  softmin_rows<false>(rows, columns, s, scratch, softmin, nullptr);
}

inline void softmin_adjoint(const WeightedPoints& rows, const WeightedPoints& columns,
                            const double* potentials, double epsilon, double* scratch,
                            const double* softmin, const double* grad_softmin, double* grad_rows,
                            double* grad_columns, double* grad_potentials) {
  using namespace softmin_detail;
  const double s = kLog2E / epsilon;
  column_exponents(columns, potentials, s, scratch);
  const ColumnSums sums =
      empty_column_sums(scratch + columns.padded, columns.padded, grad_columns != nullptr);
  if (grad_columns) {
    softmin_adjoint_rows<true>(rows, columns, s, scratch, softmin, grad_softmin, grad_rows, sums);
  } else {
    softmin_adjoint_rows<false>(rows, columns, s, scratch, softmin, grad_softmin, grad_rows, sums);
  }
  add_column_sums(columns, sums, -1, grad_columns, grad_potentials);
}

inline void barycentres(const WeightedPoints& rows, const WeightedPoints& columns,
                        const double* potentials, double epsilon, double* scratch, double* softmin,
                        double* barycentres) {
  using namespace softmin_detail;
  const double s = kLog2E / epsilon;
  column_exponents(columns, potentials, s, scratch);
  softmin_rows<true>(rows, columns, s, scratch, softmin, barycentres);
}

inline void barycentres_adjoint(const WeightedPoints& rows, const WeightedPoints& columns,
                                const double* potentials, double epsilon, double* scratch,
                                const double* softmin, const double* barycentres,
                                const double* grad_barycentres, double* grad_rows,
                                double* grad_columns, double* grad_potentials) {
  using namespace softmin_detail;
  const double s = kLog2E / epsilon;
  column_exponents(columns, potentials, s, scratch);
  const ColumnSums sums =
      empty_column_sums(scratch + columns.padded, columns.padded, grad_columns != nullptr);
  if (grad_columns) {
    barycentres_adjoint_rows<true>(rows, columns, s, scratch, softmin, barycentres,
                                   grad_barycentres, grad_rows, sums);
  } else {
    barycentres_adjoint_rows<false>(rows, columns, s, scratch, softmin, barycentres,
                                    grad_barycentres, grad_rows, sums);
  }
  add_column_sums(columns, sums, 1, grad_columns, grad_potentials);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
