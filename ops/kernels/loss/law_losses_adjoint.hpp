#pragma once

#include "ops/kernels/loss/law_losses.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {
namespace isotropic_detail {

/// Gradients of one vector of samples.
template <class V>
struct CapGradients {
  V output[kCapOutputs];
  V c2, log_e;
};
/// per_error, per_whole, per_share: dL/d(error, error_whole, share).
template <class V>
UNIPHY_INLINE CapGradients<V> projection_errors_adjoint(const ProjectionErrors<V>& p, const V& e,
                                                        const V& per_error, const V& per_whole,
                                                        const V& per_share) {
  using T = ScalarOf<V>;
  const V zero(T(0)), one(T(1)), two(T(2)), norm = p.trial.norm;
  const V g_partial = two * p.partial * p.inverse_size2 * per_error;
  const V g_whole = two * p.whole * p.inverse_size2 * per_whole;
  const V g_others = two * p.inverse_size2 * (per_error + per_whole);

  // ‖ε̂‖, by what the law does with it. Where it leaves ‖ε̂‖ alone the share's weight is a constant.
  const auto positive = p.cap_q > zero;
  const V of_cap = lane_fma(g_partial, one - p.kept.per_excess, g_whole);
  const V cut_q = lane_fma(g_others, p.above, -of_cap);
  const V zero_q = select<V>(positive, of_cap, zero);
  const V missed_q = select<V>(norm > p.cap_q, -(p.missed_weight * (g_partial + g_whole)), zero);
  const V g_q = select<V>(p.to_zero, zero_q, select<V>(p.cuts, cut_q, missed_q));
  // e y, which stays where it cuts to 0 and is not taken off where it cuts to something.
  const V g_kept = e * select<V>(p.to_zero, g_partial, select<V>(p.cuts, -g_partial, zero));
  const V g_viscosity = lane_fma(g_kept, p.kept.per_viscosity, per_share * p.share.per_viscosity);

  // of_fluid is 0 unless c₁ moves it.
  const V of_fluid = g_others * p.of_fluid * V(T(kFluidWeight)) * norm;
  const V g_c1 = lane_fma(g_q, e, of_fluid);
  // of_trace is 0 unless T moves it.
  const V of_trace = g_others * p.of_trace * V(T(1.0 / 3));
  const V g_c2 = select<V>(p.cuts_trace, of_trace, -of_trace) * e;

  CapGradients<V> g;
  g.output[kCap] = g_c1;
  g.output[kTraceCap] = g_c2;
  g.output[kCapSlope] = g_c1 * p.cap.per_m;
  g.output[kCapViscosity] = g_viscosity * p.cap.per_viscosity;
  g.output[kFlowExponent] = g_kept * p.kept.per_exponent * p.cap.per_exponent;
  g.c2 = g_c2;
  // Q = e c₁, T = e c₂ and e y(x/e); c₁ itself sees t/e.
  g.log_e = g_q * p.cap_q + g_c2 * p.cap.c2 - g_c1 * p.cap.slope * p.trial.trace / e +
            g_kept * (p.kept.value - p.kept.per_excess * p.excess);
  return g;
}

template <class V, class T>
UNIPHY_INLINE CoefficientGradients<V> stress_errors_adjoint(const IsotropicAnswers<T>& a,
                                                            const StressErrors<V>& r,
                                                            const AnswerLanes<V>& answers,
                                                            const V& inv_e, const V& per_error) {
  const Coefficients<V>& c = answers.coefficients;
  const Mat3<V> S = r.difference * (per_error * r.inverse_size2 * V(T(2) * a.stress_scale));
  return coefficient_gradients(r.state, c, r.measures, S, dot(S, r.state.rate_frame),
                               answers.moduli, inv_e);
}

/// Gradients of network outputs: one for each sample, or their sum.
template <int outputs, class V>
class OutputGradients {
 public:
  using T = ScalarOf<V>;
  OutputGradients(T* to, bool of_state) : to_(to), of_state_(of_state) {
    for (V& sum : sums_) sum = V(T(0));
  }
  UNIPHY_INLINE void add(std::ptrdiff_t first, std::ptrdiff_t count, const V* g) {
    if (!to_) return;
    for (int k = 0; k < outputs; ++k) {
      if (of_state_)
        store_lanes<V, T>({to_, 1, count}, first, k, count - first, g[k]);
      else
        sums_[k] = sums_[k] + g[k];
    }
  }
  void finish() const {
    for (int k = 0; to_ && !of_state_ && k < outputs; ++k) to_[k] = lane_sum(sums_[k]);
  }

 private:
  T* to_;
  bool of_state_;
  V sums_[outputs];
};

}  // namespace isotropic_detail

template <class T>
inline void law_losses_adjoint(const IsotropicAnswers<T>& a, const T* weights,
                               IsotropicAnswersGradient<T>& gradient) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  const V zero(T(0)), e(a.samples.strain_scale), inv_e(T(1) / a.samples.strain_scale);
  const V delta(a.delta);
  OutputGradients<kCapOutputs, V> of_caps(gradient.caps, a.state_caps);
  OutputGradients<kStressOutputs, V> of_moduli(gradient.moduli, a.state_moduli);
  V rest_cap = zero, rest_pressure = zero, log_s = zero, log_e = zero;
  AnswerLanes<V> answers(a);
  for (std::ptrdiff_t l = 0; l < a.samples.count; l += width_of<V>) {
    const SampleLanes<V> sample(a.samples, l);
    answers.load(a, l);
    const V share_of_mean = first_lanes<V>(a.samples.count - l) * V(T(1) / T(a.samples.count));
    // d log(1 + x/δ)/dx = 1/(δ + x)
    const auto weight = [&](int k) { return share_of_mean * V(weights[k]); };
    const ProjectionErrors<V> p = projection_errors<V, T>(a, sample, answers.caps, inv_e);
    const CapGradients<V> g =
        projection_errors_adjoint(p, e, weight(kProjectionLoss) / (delta + p.error),
                                  weight(kWholeLoss) / (delta + p.error_whole), weight(kShare));
    of_caps.add(l, a.samples.count, g.output);
    rest_cap = rest_cap - g.c2;
    const StressErrors<V> s = stress_errors<V, T>(a, sample, answers.coefficients, inv_e);
    const CoefficientGradients<V> h =
        stress_errors_adjoint<V, T>(a, s, answers, inv_e, weight(kStressLoss) / (delta + s.error));
    of_moduli.add(l, a.samples.count, h.output);
    rest_pressure = rest_pressure - h.a0;
    log_s = log_s + h.log_s;
    log_e = log_e + g.log_e + h.log_e;
  }
  of_caps.finish();
  of_moduli.finish();
  gradient.rest_cap = lane_sum(rest_cap);
  gradient.rest_pressure = lane_sum(rest_pressure);
  gradient.log_s = lane_sum(log_s);
  gradient.log_e = lane_sum(log_e);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
