#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "uniphy/inference/initial_state.hpp"

namespace uniphy {

/// All numbers of a state, [initial_numbers(degree)] float64: linear (m/s), angular (rad/s), the
/// others.
torch::Tensor numbers_of(const InitialState& state);
/// The state with those in their place.
InitialState with_numbers(const InitialState& state, const torch::Tensor& numbers);

/// What a roll-out starts from, float64: v [N, 3] m/s, C [N, 3, 3] 1/s and F [N, 3, 3], undefined
/// where they are 0 and I.
struct InitialFields {
  torch::Tensor v, C = {}, F = {};
};

/// The fields of states of one centre, radius and degree at positions x [N, 3] m, of which those
/// from `particles` on are tracers, whose F is I at the start whatever the body's is.
class InitialBasis {
 public:
  InitialBasis(const std::vector<double>& x, std::int64_t particles, const InitialState& state);

  /// Of all numbers of a state; gradients go through it.
  InitialFields fields(const torch::Tensor& numbers) const;

 private:
  int degree_;
  std::int64_t particles_;
  torch::Tensor arm_;        ///< [N, 3] m
  torch::Tensor monomials_;  ///< [N, all of degree ≤ d]
  torch::Tensor slopes_;     ///< [N, 3, those of degree ≥ 2] 1/m
};

InitialFields fields_of(const InitialState& state, const std::vector<double>& x,
                        std::int64_t particles);

/// The monomials of r/radius [N, 3] up to a degree, [N, terms]: 1, the coordinates, the squares and
/// products, …; and their slopes [N, 3, terms] by those coordinates.
struct Monomials {
  torch::Tensor value, slope;
};
Monomials monomials(const torch::Tensor& r, int degree);

}  // namespace uniphy
