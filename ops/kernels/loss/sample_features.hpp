#pragma once

#include <algorithm>

#include "ops/kernels/learned/isotropic_stress.hpp"
#include "ops/kernels/loss/law_losses_table.hpp"
#include "ops/kernels/simd/transpose4.hpp"

// Vectors of samples of the isotropic form, and the features that networks see of them
// (isotropic_law.hpp).

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// One vector of samples. Lanes beyond the last sample repeat it and are to weigh nothing.
template <class V>
class SampleLanes {
 public:
  using T = ScalarOf<V>;

  SampleLanes(const SampleFeatures<T>& samples, std::ptrdiff_t first) {
    constexpr int w = width_of<V>;
    // Rows lie anywhere in a table larger than the caches: ask for those of the vectors to come.
    const std::ptrdiff_t ahead = first + kVectorsAhead * w;
    for (std::ptrdiff_t l = ahead; l < std::min(ahead + w, samples.count); ++l) fetch(samples, l);
    for (std::ptrdiff_t l = 0; first == 0 && l < std::min(ahead, samples.count); ++l)
      fetch(samples, l);
    constexpr int columns = SampleColumns::count;
    const T* row[w];
    for (int l = 0; l < w; ++l)
      row[l] = samples.columns + samples.rows[std::min(first + l, samples.count - 1)] * columns;
    if constexpr (w % 4 == 0) {
      for (int l = 0; l < w; l += 4) {
        for (int next = 0; next < columns; next += 4) {
          const int k = std::min(next, columns - 4);
          transpose4<T>({row[l] + k, row[l + 1] + k, row[l + 2] + k, row[l + 3] + k},
                        plane_ + k * w + l, w);
        }
      }
    } else {
      for (int l = 0; l < w; ++l)
        for (int k = 0; k < columns; ++k) plane_[k * w + l] = row[l][k];
    }
  }

  UNIPHY_INLINE V operator[](int column) const {
    if constexpr (is_scalar_lane<V>)
      return plane_[column];
    else
      return V::load_aligned(plane_ + column * width_of<V>);
  }
  UNIPHY_INLINE Vec3<V> vector(int column) const {
    return {{(*this)[column], (*this)[column + 1], (*this)[column + 2]}};
  }
  UNIPHY_INLINE Mat3<V> symmetric(int column) const {
    const V xy = (*this)[column + 3], xz = (*this)[column + 4], yz = (*this)[column + 5];
    return {{(*this)[column], xy, xz, xy, (*this)[column + 1], yz, xz, yz, (*this)[column + 2]}};
  }

 private:
  static constexpr std::ptrdiff_t kVectorsAhead = 64 / width_of<V>;

  static UNIPHY_INLINE void fetch(const SampleFeatures<T>& samples, std::ptrdiff_t sample) {
    const T* row = samples.columns + samples.rows[sample] * SampleColumns::count;
    for (int k = 0; k < SampleColumns::count; k += 64 / int(sizeof(T))) __builtin_prefetch(row + k);
    __builtin_prefetch(row + SampleColumns::count - 1);
  }

  alignas(64) T plane_[SampleColumns::count * width_of<V>];
};

/// 1 in the first `count` lanes, else 0.
template <class V>
UNIPHY_INLINE V first_lanes(std::ptrdiff_t count) {
  using T = ScalarOf<V>;
  if constexpr (is_scalar_lane<V>) {
    return T(count > 0);
  } else {
    alignas(64) T one[width_of<V>];
    for (int l = 0; l < width_of<V>; ++l) one[l] = T(l < count);
    return V::load_aligned(one);
  }
}

namespace isotropic_detail {

/// The strain of the trial F; `stretch` only where asked for.
template <class V>
UNIPHY_INLINE HenckyStrain<V> trial_strain(const SampleLanes<V>& sample, bool stretch) {
  HenckyStrain<V> h;
  h.deviator = sample.vector(SampleColumns::deviator);
  h.trace = sample[SampleColumns::trace];
  h.norm = lane_sqrt(dot(h.deviator, h.deviator));
  const V mean = h.trace * V(ScalarOf<V>(1.0 / 3));
  for (int i = 0; stretch && i < 3; ++i) h.stretch[i] = lane_exp(h.deviator[i] + mean);
  return h;
}

/// stress_state in the frame of the projected F.
template <class V>
UNIPHY_INLINE StressState<V> sample_state(const SampleLanes<V>& sample, const V& inv_e) {
  const V third(ScalarOf<V>(1.0 / 3));
  HenckyStrain<V> h;
  h.deviator = sample.vector(SampleColumns::projected_deviator);
  h.trace = sample[SampleColumns::projected_trace];
  for (int i = 0; i < 3; ++i) h.eps[i] = lane_fma(h.trace, third, h.deviator[i]);
  Mat3<V> rate = sample.symmetric(SampleColumns::rate);
  const V rate_trace = trace(rate);
  for (int k = 0; k < 9; k += 4) rate.e[k] = rate.e[k] - rate_trace * third;
  return stress_state(h, rate, rate_trace, rate, inv_e);
}

}  // namespace isotropic_detail

template <class T>
inline void isotropic_features(const SampleFeatures<T>& samples, T* projection, T* stress) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  const V inv_e(T(1) / samples.strain_scale);
  for (std::ptrdiff_t l = 0; l < samples.count; l += width_of<V>) {
    const SampleLanes<V> sample(samples, l);
    const auto put = [&](T* to, int k, const V& value) {
      store_lanes<V, T>({to, 1, samples.count}, l, k, samples.count - l, value);
    };
    const HenckyStrain<V> trial = trial_strain(sample, false);
    const StrainInvariants<V> v = strain_invariants(trial, inv_e);
    put(projection, 0, trial.trace * inv_e);
    put(projection, 1, v.q);
    put(projection, 2, v.cubic);
    const StressState<V> s = sample_state(sample, inv_e);
    put(stress, 0, s.volumetric);
    put(stress, 1, s.invariants.q);
    put(stress, 2, s.invariants.cubic);
    put(stress, 3, s.rate_trace);
    put(stress, 4, s.rate_norm);
    put(stress, 5, s.x);
  }
}

template <class T>
inline T isotropic_features_adjoint(const SampleFeatures<T>& samples, const T* grad_projection,
                                    const T* grad_stress) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  const V inv_e(T(1) / samples.strain_scale);
  V log_e(T(0));
  for (std::ptrdiff_t l = 0; l < samples.count; l += width_of<V>) {
    const SampleLanes<V> sample(samples, l);
    // Missing lanes read zero gradients.
    const auto gradient = [&](const T* from, int k) {
      return load_lanes<V, T>({from, 1, samples.count}, l, k, samples.count - l, T(0));
    };
    // Everything but the rate goes as 1/e, through t/e and w = ε̂/e.
    if (grad_projection) {
      const HenckyStrain<V> trial = trial_strain(sample, false);
      const StrainInvariants<V> v = strain_invariants(trial, inv_e);
      const V g_q = gradient(grad_projection, 1), g_cubic = gradient(grad_projection, 2);
      log_e = log_e - gradient(grad_projection, 0) * trial.trace * inv_e;
      for (int i = 0; i < 3; ++i)
        log_e = log_e - lane_fma(g_cubic, v.d_cubic[i], g_q * v.w[i] * v.inverse_root) * v.w[i];
    }
    if (grad_stress) {
      const StressState<V> s = sample_state(sample, inv_e);
      V f[6];
      for (int k = 0; k < 6; ++k) f[k] = gradient(grad_stress, k);
      const FeatureGradients<V> of = feature_gradients(s, f);
      const StrainInvariants<V>& v = s.invariants;
      log_e = log_e - f[0] * s.volumetric;
      for (int i = 0; i < 3; ++i)
        log_e = log_e - (of.aligned * s.rate_frame(i, i) + of.q * v.w[i] * v.inverse_root +
                         f[2] * v.d_cubic[i]) *
                            v.w[i];
    }
  }
  return lane_sum(log_e);
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
