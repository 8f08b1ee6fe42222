#pragma once

#include "ops/kernels/mlp/packed_mlp.hpp"
#include "ops/kernels/simd/dispatch.hpp"
#include "ops/kernels/simd/view.hpp"

namespace uniphy::kernels {

/// A learned law with one latent folded in, as the kernels read it. All pointers are borrowed.
template <class T>
struct LearnedLaw {
  LawForm form;
  PackedMlp<T> projection;
  PackedMlp<T> stress;
  T stress_scale;  ///< s, Pa
  T strain_scale;  ///< e
  // Isotropic form: the networks' own answers at F = I, C = 0, which are taken off so that rest is
  // a state without yield and without stress.
  T rest_pressure;  ///< a₀, in units of s
  T rest_cap;       ///< min(c₂, 0)
  // The answers of networks whose state features have no weight, [out, kTile], or null.
  const T* constant_projection;
  const T* constant_stress;

  /// Layout of the running sum of an adjoint: gradients of the two folded first biases, then
  /// dL/d(log s), dL/d(log e), dL/d(rest_pressure), dL/d(rest_cap), then those of the outputs of
  /// networks that answer to z alone.
  std::ptrdiff_t scale_sums() const { return projection.layer[0].out + stress.layer[0].out; }
  std::ptrdiff_t cap_sums() const { return scale_sums() + 4; }
  std::ptrdiff_t coefficient_sums() const { return cap_sums() + projection.out(); }
  std::ptrdiff_t accumulator_size() const { return coefficient_sums() + stress.out(); }

  /// Layout of the running sum of the weights: those of the two networks (PackedMlp::weight_sums),
  /// then, of networks that answer to z alone, Σ g xᵀ [out, in] of what their outputs receive and
  /// the features that they would see: through the network at rest this is what the first weight,
  /// zero as it is there, would gain.
  std::ptrdiff_t stress_weight_sums() const { return projection.weight_sums(); }
  std::ptrdiff_t projection_feature_sums() const {
    return stress_weight_sums() + stress.weight_sums();
  }
  std::ptrdiff_t stress_feature_sums() const {
    return projection_feature_sums() + projection.out() * projection.in();
  }
  /// Whole vectors, so that one running sum after the other is aligned.
  std::ptrdiff_t weight_sums_size() const {
    return weight_stride(int(stress_feature_sums()) + stress.out() * stress.in());
  }
};

/// The learned law's inner loops on one instruction set.
template <class T>
struct LearnedLawTable {
  /// Scratch numbers of evaluate and adjoint.
  std::ptrdiff_t (*scratch)(const LearnedLaw<T>&);
  /// LawKernel::evaluate of at most kTile particles; flow_time: kFlowStep over the time step.
  void (*evaluate)(const LearnedLaw<T>&, T flow_time, std::ptrdiff_t count, View<const T> F_trial,
                   View<const T> C, View<T> F_proj, View<T> tau, T* scratch);
  /// LawKernel::adjoint of at most kTile particles; grad_F_proj and grad_tau must be given.
  void (*adjoint)(const LearnedLaw<T>&, T flow_time, std::ptrdiff_t count, View<const T> F_trial,
                  View<const T> C, View<const T> grad_F_proj, View<const T> grad_tau,
                  View<T> grad_F_trial, View<T> grad_C, T* accumulator, T* weight_sums, T* scratch);
  /// A bare network on one tile of planes: in [padded(in), kTile] → [padded(out), kTile] in
  /// `scratch` of forward_scratch() numbers.
  const T* (*mlp_forward)(const PackedMlp<T>&, const T* in, T* scratch);
  /// What mlp_backward needs of mlp_forward: a tape of tape_scratch() numbers.
  void (*mlp_tape)(const PackedMlp<T>&, const T* in, T* tape);
  /// The adjoint, given the tape; grad_in, first_bias, weight_sums may be null.
  void (*mlp_backward)(const PackedMlp<T>&, const T* in, T* tape, const T* grad_out, T* grad_in,
                       T* first_bias, T* weight_sums);
};

UNIPHY_ISA_TABLE(LearnedLawTable<float>)
UNIPHY_ISA_TABLE(LearnedLawTable<double>)

/// The table of the active instruction set (isa.hpp).
template <class T>
const LearnedLawTable<T>& learned_law_table() {
  return table_of<LearnedLawTable<T>>();
}

}  // namespace uniphy::kernels
