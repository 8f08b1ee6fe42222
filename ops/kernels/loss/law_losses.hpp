#pragma once

#include "ops/kernels/loss/sample_features.hpp"

// The errors of law_losses_table.hpp for vectors of samples.

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace isotropic_detail {

/// The least weight of a cap that is missed where the law does not cut.
inline constexpr double kLeastShare = 0.05;
/// Keeps a trajectory without any size from dividing by zero.
inline constexpr double kLeastSize2 = 1e-20;
/// The weight of a fluid's cap beside the errors of its strain.
inline constexpr double kFluidWeight = 0.1;

template <class V>
struct ProjectionErrors {
  HenckyStrain<V> trial;
  Caps<V> cap;
  V cap_q, cap_t;           ///< Q, T
  MaskOf<V> cuts, to_zero;  ///< the law cuts ‖ε̂‖ to something, to 0
  MaskOf<V> cuts_trace;
  ReturnShare<V> share;         ///< r
  V missed_weight;              ///< max(r, 0.05)
  KeptExcess<V> kept;           ///< y, in units of e
  V excess;                     ///< x, likewise
  V partial, whole;             ///< a, and a with y = 0
  V above, of_fluid, of_trace;  ///< the parts of o
  V inverse_size2;
  V error, error_whole;
};
template <class V, class T>
UNIPHY_INLINE ProjectionErrors<V> projection_errors(const IsotropicAnswers<T>& a,
                                                    const SampleLanes<V>& sample,
                                                    const CapOutputs<V>& outputs, const V& inv_e) {
  using Column = SampleColumns;
  const V zero(T(0)), one(T(1)), half(T(0.5)), third(T(1.0 / 3)), e(a.samples.strain_scale);
  ProjectionErrors<V> p;
  p.trial = trial_strain(sample, true);
  p.cap = caps(outputs, V(a.rest_cap), p.trial.trace * inv_e, p.trial.stretch);
  p.cap_q = e * p.cap.c1;
  p.cap_t = e * p.cap.c2;
  const V kind = sample[Column::norm_yields], norm = p.trial.norm;
  p.to_zero = kind > V(T(1.5));
  p.cuts = kind > half && kind < V(T(1.5));
  p.cuts_trace = sample[Column::trace_yields] > half;
  const V norm_decrease = sample[Column::norm_decrease];
  const V trace_decrease = sample[Column::trace_decrease];
  p.share = return_share(p.cap);
  p.missed_weight = lane_max(V(T(kLeastShare)), p.share.value);
  const V missed = lane_max(zero, norm - p.cap_q) * p.missed_weight;
  const V cap_q = select<V>(p.to_zero, lane_max(zero, p.cap_q), p.cap_q), over = norm - cap_q;
  p.excess = over * inv_e;
  p.kept = kept_excess<V>(p.excess, p.cap);
  const V kept = e * p.kept.value;
  p.partial =
      select<V>(p.to_zero, cap_q + kept, select<V>(p.cuts, over - kept - norm_decrease, missed));
  p.whole = select<V>(p.to_zero, cap_q, select<V>(p.cuts, over - norm_decrease, missed));
  p.above = select<V>(p.cuts, lane_max(zero, p.cap_q - norm + norm_decrease), zero);
  const auto fluid = p.to_zero && !p.cuts_trace;
  p.of_fluid = select<V>(
      fluid, V(T(kFluidWeight)) * norm * lane_max(zero, p.cap.c1 - V(T(2 * kFluidCap))), zero);
  const V t = p.trial.trace, least_cap = select<V>(fluid, t + lane_max(zero, t), t);
  p.of_trace = select<V>(p.cuts_trace, p.cap_t - sample[Column::projected_trace],
                         lane_max(zero, least_cap - p.cap_t));
  const V decrease2 =
      lane_fma(norm_decrease, norm_decrease, trace_decrease * trace_decrease * third);
  p.inverse_size2 = one / (decrease2 + V(a.strain_floor2 + T(kLeastSize2)));
  const V others =
      lane_fma(p.above, p.above, lane_fma(p.of_fluid, p.of_fluid, p.of_trace * p.of_trace * third));
  p.error = lane_fma(p.partial, p.partial, others) * p.inverse_size2;
  p.error_whole = lane_fma(p.whole, p.whole, others) * p.inverse_size2;
  return p;
}

template <class V>
struct StressErrors {
  StressState<V> state;
  Measures<V> measures;
  Mat3<V> difference;  ///< τ̂ − τ, in the frame of the projected F
  V inverse_size2;
  V error;
};
template <class V, class T>
UNIPHY_INLINE StressErrors<V> stress_errors(const IsotropicAnswers<T>& a,
                                            const SampleLanes<V>& sample, const Coefficients<V>& c,
                                            const V& inv_e) {
  const V s(a.stress_scale);
  StressErrors<V> r;
  r.state = sample_state(sample, inv_e);
  r.measures = measures(r.state, c, inv_e);
  const Vec3<V> diagonal = basis_diagonal(r.state, c, r.measures, inv_e);
  const Mat3<V> tau = sample.symmetric(SampleColumns::stress);
  Mat3<V> predicted = r.state.rate_frame * r.measures.viscosity;
  for (int i = 0; i < 3; ++i) predicted(i, i) = predicted(i, i) + diagonal[i];
  r.difference = predicted * s - tau;
  r.inverse_size2 = V(T(1)) / (dot(tau, tau) + V(a.stress_floor2 + T(kLeastSize2)));
  r.error = dot(r.difference, r.difference) * r.inverse_size2;
  return r;
}

/// Outputs of the networks for a vector of samples from `first` on.
template <int outputs, class V, class T>
UNIPHY_INLINE void load_answers(const T* from, bool of_state, std::ptrdiff_t first,
                                std::ptrdiff_t count, V (&o)[outputs]) {
  for (int k = 0; k < outputs; ++k)
    o[k] =
        of_state ? load_lanes<V, T>({from, 1, count}, first, k, count - first, T(0)) : V(from[k]);
}

/// The answers to one vector of samples; those that are constants are read once.
template <class V>
struct AnswerLanes {
  using T = ScalarOf<V>;
  V moduli[kStressOutputs];
  CapOutputs<V> caps;
  Coefficients<V> coefficients;

  explicit AnswerLanes(const IsotropicAnswers<T>& a) {
    if (!a.state_caps) load_caps(a, 0);
    if (!a.state_moduli) load_moduli(a, 0);
  }
  UNIPHY_INLINE void load(const IsotropicAnswers<T>& a, std::ptrdiff_t first) {
    if (a.state_caps) load_caps(a, first);
    if (a.state_moduli) load_moduli(a, first);
  }

 private:
  UNIPHY_INLINE void load_caps(const IsotropicAnswers<T>& a, std::ptrdiff_t first) {
    V o[kCapOutputs];
    load_answers(a.caps, a.state_caps, first, a.samples.count, o);
    caps = cap_outputs(o, V(a.flow_time));
  }
  UNIPHY_INLINE void load_moduli(const IsotropicAnswers<T>& a, std::ptrdiff_t first) {
    load_answers(a.moduli, a.state_moduli, first, a.samples.count, moduli);
    coefficients = isotropic_detail::coefficients(moduli, V(a.rest_pressure));
  }
};

}  // namespace isotropic_detail

template <class T>
inline void law_losses(const IsotropicAnswers<T>& a, T* means) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  const V inv_e(T(1) / a.samples.strain_scale), inv_delta(T(1) / a.delta);
  V sums[kIsotropicMeans];
  for (V& sum : sums) sum = V(T(0));
  AnswerLanes<V> answers(a);
  for (std::ptrdiff_t l = 0; l < a.samples.count; l += width_of<V>) {
    const SampleLanes<V> sample(a.samples, l);
    answers.load(a, l);
    const V weight = first_lanes<V>(a.samples.count - l);
    const auto add = [&](int k, const V& value) { sums[k] = lane_fma(weight, value, sums[k]); };
    const ProjectionErrors<V> p = projection_errors<V, T>(a, sample, answers.caps, inv_e);
    add(kProjectionLoss, lane_log1p(p.error * inv_delta));
    add(kWholeLoss, lane_log1p(p.error_whole * inv_delta));
    add(kShare, p.share.value);
    add(kProjectionError, p.error);
    const StressErrors<V> s = stress_errors<V, T>(a, sample, answers.coefficients, inv_e);
    add(kStressLoss, lane_log1p(s.error * inv_delta));
    add(kStressError, s.error);
  }
  for (int k = 0; k < kIsotropicMeans; ++k) means[k] = lane_sum(sums[k]) / T(a.samples.count);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
