#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>

// Distances of the particles of a roll-out from observed clouds without correspondence: another
// number of points in every frame, in any order. They come as residuals r of which the sum of
// squares over a frame is the distance in m²: a mean square, summed over the three coordinates. M_f
// points y of the cloud of a frame, P particles x with weights w_p whose sum is 1, nn(·) the
// nearest point of the other set:
//   nearest    r_m = √(1/M_f) (x_nn(y_m) − y_m)
//              one-sided: for clouds that show a part of the body only, as its visible surface
//   chamfer    √½ times the above, and r_p = √(½ w_p) (x_p − y_nn(x_p)): the mean of both sides
//   transport  r_p = √w_p (T_xx(x_p) − T_xy(x_p)), the displacement of debiased entropic optimal
//              transport (ops/kernels/loss/transport.hpp, after J. Feydy et al., AISTATS 2019): 0
//              at x = y, the way to the cloud for a copy that is moved, and about the squared
//              2-Wasserstein distance in all, with clouds that show the whole body
// float64, CPU. The same bits on any number of threads: a frame is the work of one.

namespace uniphy::ops {

enum class CloudDistance { nearest, chamfer, transport };

struct CloudSettings {
  CloudDistance distance = CloudDistance::transport;
  double blur = 0;     ///< m, > 0; of transport: structure below this length is not told apart
  int iterations = 4;  ///< of transport at that length, ≥ 1, after those that lead down to it
};

/// A blur length (m) for P particles of a body of `volume` m³: half their mean spacing. What least
/// squares of the residuals of 1000 particles on a lattice recover of an affine deformation is off
/// by these parts of it (root mean square over twelve clouds of 1000 random points of the body,
/// each by itself, with noise of 0.5 % of the size):
///   blur / spacing        0.25  0.5   0.75  1     1.5   2     3
///   deformation of 3 %    1.33  1.40  1.61  1.79  2.10  2.27  2.24
///   deformation of 10 %   0.72  0.45  0.49  0.54  0.63  0.68  0.67
/// Most of it is the randomness of a cloud, which averages out over frames: of the mean of the
/// twelve 0.20 is left at 10 % and half the spacing, 0.62 at a quarter. Ten iterations at the blur
/// length are no better than four.
double default_blur(double volume, std::int64_t particles);

class CloudTargets {
 public:
  /// clouds [F, M, 3] m, rows of NaN where a frame has fewer points than M, anywhere in the frame;
  /// weights [P] > 0, in any unit. Both float64. Throws Error naming the argument, what was
  /// expected and what was found: shapes, dtype, a row that is neither finite nor NaN, weights that
  /// are not positive, no point in any frame, settings out of range.
  CloudTargets(const torch::Tensor& clouds, const torch::Tensor& weights,
               const CloudSettings& settings);

  /// x [f ≤ F, P, 3] m, the particles at the first f frames, → [f, R]. Once differentiable by x;
  /// transport's derivative is that of its fixed number of iterations, nearest neighbours are taken
  /// as given. 0 for a frame without a point and for rows of NaN; NaN throughout, gradient as
  /// value, for a frame in which x is not finite. Throws Error for another shape or dtype of x.
  torch::Tensor residuals(const torch::Tensor& x) const;

  std::int64_t frames() const;
  /// R: 3 M of nearest (those of row m of the cloud stand at 3 m), 3 M + 3 P of chamfer, 3 P of
  /// transport.
  std::int64_t residuals_per_frame() const;

  struct State;

 private:
  std::shared_ptr<const State> state_;
};

}  // namespace uniphy::ops
