#pragma once

#include "ops/kernels/mlp/packed_mlp.hpp"

namespace uniphy::kernels {

/// Both networks of a learned law as the kernels read them, before any z is folded in.
template <class T>
struct PackedNetworks {
  /// Throws Error where the weights do not fit (LearnedLawWeights::check).
  explicit PackedNetworks(const LearnedLawWeights& weights);

  PackedMlpStorage<T> projection, stress;
  /// Whether the networks answer to z alone (ignores_state).
  bool projection_ignores_state, stress_ignores_state;
};

}  // namespace uniphy::kernels
