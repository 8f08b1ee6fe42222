#pragma once

#include <cstddef>
#include <vector>

#include "ops/kernels/loss/softmin_table.hpp"

// The displacement of debiased entropic optimal transport between weighted particles x [P, 3] and a
// cloud y [M, 3]: T_xx(x_p) − T_xy(x_p), barycentres of the entropic plans of the particles with
// themselves and with the cloud. The gradient of the Sinkhorn divergence by x_p is the weight w_p
// times it (J. Feydy et al., Interpolating between Optimal Transport and MMD using Sinkhorn
// Divergences, AISTATS 2019). Cost ½|x − y|², temperature ε = blur².
//
// The potentials f (particles), g (cloud) and p (particles with themselves) are found as there, by
// symmetrised iterations in the log domain whose temperature falls,
//   f ← ½ (f + softmin_j(g)), g ← ½ (g + softmin_i(f)), p ← ½ (p + softmin(p)), both old f and g
// the first of them whole and from zero potentials; the barycentres are those of the last
// potentials g and p. The number of iterations and their ε are given beforehand, so that the result
// is one smooth function of x; the adjoint goes back through all of them and is its derivative to
// rounding. All the memory is a few numbers for each point and iteration.

namespace uniphy::kernels {

/// ε of each iteration, m². The blur length √ε starts from `extent` (m), the largest distance that
/// matters, and halves down to `blur` (m); at `blur` itself there are `iterations` (≥ 1).
std::vector<double> transport_schedule(double extent, double blur, int iterations);

/// Numbers that the forward pass keeps for the adjoint.
std::ptrdiff_t transport_history_size(std::size_t iterations, std::ptrdiff_t padded_particles,
                                      std::ptrdiff_t padded_cloud);

/// What both passes are given. Padding and memory as in softmin_table.hpp; one thread.
struct TransportProblem {
  WeightedPoints particles, cloud;
  const std::vector<double>* schedule;
};
/// displacement: three planes, m; history: [transport_history_size].
void transport_displacement(const TransportProblem& problem, double* history, double* displacement);
/// Adds dL/dx to three planes, given the history and dL/d(displacement).
void transport_displacement_adjoint(const TransportProblem& problem, const double* history,
                                    const double* grad_displacement, double* grad_x);

}  // namespace uniphy::kernels
