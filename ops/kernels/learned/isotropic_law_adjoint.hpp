#pragma once

#include <algorithm>

#include "ops/kernels/learned/isotropic_law.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// Where network_backward adds gradients; each may be null.
template <class T>
struct NetworkSums {
  T* first_bias;  ///< of the folded first bias
  T* outputs;     ///< of the outputs of a network that answers to z alone
  T* weights;     ///< PackedMlp::weight_sums
  T* features;    ///< [out, in], outputs × features of a network that answers to z alone
};

/// The adjoint of network(). One that answers to z alone has the gradient of its outputs added to
/// sums.outputs and sums.features instead, and none of its features.
template <class T>
void network_backward(const PackedMlp<T>& net, const T* constant, const T* in, T* tape,
                      const T* grad_out, T* grad_in, const NetworkSums<T>& sums) {
  using V = Lanes<T>;
  constexpr std::ptrdiff_t w = width_of<V>;
  if (!constant)
    return mlp_backward<T>(net, in, tape, grad_out, grad_in, sums.first_bias, sums.weights);
  std::fill_n(grad_in, net.in() * kTile, T(0));
  for (int o = 0; sums.outputs && o < net.out(); ++o) {
    V sum(T(0));
    for (std::ptrdiff_t l = 0; l < kTile; l += w)
      sum = sum + V::load_aligned(grad_out + o * kTile + l);
    sums.outputs[o] += lane_sum(sum);
  }
  for (int o = 0; sums.features && o < net.out(); ++o) {
    for (int i = 0; i < net.in(); ++i) {
      V sum(T(0));
      for (std::ptrdiff_t l = 0; l < kTile; l += w)
        sum = lane_fma(V::load_aligned(grad_out + o * kTile + l),
                       V::load_aligned(in + i * kTile + l), sum);
      sums.features[o * net.in() + i] += lane_sum(sum);
    }
  }
}

/// The adjoint of isotropic_evaluate, recomputing its forward pass tile by tile. Overwrites
/// grad_F_trial, adds to grad_C, to the accumulator and to weight_sums (laid out as LearnedLaw
/// says); the last three may be null.
template <class T>
inline void isotropic_adjoint(const LearnedLaw<T>& law, T flow_time, std::ptrdiff_t count,
                              View<const T> F_trial, View<const T> C, View<const T> grad_F_proj,
                              View<const T> grad_tau, View<T> grad_F_trial, View<T> grad_C,
                              T* accumulator, T* weight_sums, T* scratch) {
  using V = Lanes<T>;
  using namespace isotropic_detail;
  constexpr int w = width_of<V>;
  const IsotropicTile<T> tile(law, scratch);
  const T *h, *a;
  isotropic_tile_forward<true>(law, flow_time, count, F_trial, C, {}, tile, h, a);
  const T e = law.strain_scale;
  const V zero(T(0)), two(T(2)), third(T(1.0 / 3)), inv_e(T(1) / e);
  const V scale(law.stress_scale);
  V sum_log_s = zero, sum_log_e = zero, sum_rest = zero, sum_cap = zero;

  const auto reload = [&](std::ptrdiff_t l, Mat3<V>& U, Vec3<V>& sigma, HenckyStrain<V>& strain,
                          Gate<V>& g, StressState<V>& s) {
    U = load_plane3<V>(tile.U, l);
    for (int k = 0; k < 3; ++k) sigma[k] = V::load_aligned(tile.sigma + k * kTile + l);
    strain = hencky_strain(sigma, true);
    g = gate<V, T>(law, flow_time, strain, h + l, tile.projection_in + l);
    s = stress_state<V, T>(U, projected_sigma<V, T>(g, sigma),
                           load_mat3<V, T>(C, l, count - l, false), e, true);
  };

  // The stress network's outputs. Lanes beyond count read zero gradients and add nothing.
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    Mat3<V> U;
    Vec3<V> sigma;
    HenckyStrain<V> strain;
    Gate<V> g;
    StressState<V> s;
    reload(l, U, sigma, strain, g, s);
    const Coefficients<V> c = coefficients<V>(law, a + l);
    const Measures<V> m = measures(s, c, inv_e);
    const Mat3<V> gt = sym(load_mat3<V, T>(grad_tau, l, count - l, false)) * scale;
    const Mat3<V> S = tmul(U, mul(gt, U));
    V o[kStressOutputs];
    load_outputs(a + l, o);
    const CoefficientGradients<V> of = coefficient_gradients(s, c, m, S, dot(gt, s.rate), o, inv_e);
    for (int k = 0; k < kStressOutputs; ++k)
      store_plane(tile.grad_stress + k * kTile, l, of.output[k]);
    sum_rest = sum_rest + of.a0;
    sum_log_e = sum_log_e + of.log_e;
    sum_log_s = sum_log_s + of.log_s;
  }
  const auto in = [](T* sums, std::ptrdiff_t at) { return sums ? sums + at : nullptr; };
  T* const feature = tile.grad_features;
  network_backward<T>(
      law.stress, law.constant_stress, tile.stress_in, tile.stress_tape, tile.grad_stress, feature,
      {in(accumulator, law.projection.layer[0].out), in(accumulator, law.coefficient_sums()),
       in(weight_sums, law.stress_weight_sums()), in(weight_sums, law.stress_feature_sums())});

  // From the stress to the frame gradient of the projected F, and on to the gate.
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    Mat3<V> U;
    Vec3<V> sigma;
    HenckyStrain<V> strain;
    Gate<V> g;
    StressState<V> s;
    reload(l, U, sigma, strain, g, s);
    const Mat3<V> Vm = load_plane3<V>(tile.V, l);
    const Coefficients<V> c = coefficients<V>(law, a + l);
    const Measures<V> m = measures(s, c, inv_e);
    V f[6], o[kStressOutputs];
    load_outputs(a + l, o);
    for (int k = 0; k < 6; ++k) f[k] = V::load_aligned(feature + k * kTile + l);
    const Mat3<V> gt = sym(load_mat3<V, T>(grad_tau, l, count - l, false)) * scale;
    const Mat3<V> S = tmul(U, mul(gt, U));
    const StrainInvariants<V>& v = s.invariants;

    const FeatureGradients<V> of = feature_gradients(s, f);
    const V g_q = of.q;

    // The diagonal, through x_i = ε̂_i + (1 − ω) t/3 and t, and the invariants of w. gd is dL/dε̂,
    // g_trace_p dL/dt. What does not enter them is not computed: everything is inlined.
    const CoefficientGradients<V> of_basis =
        coefficient_gradients(s, c, m, S, dot(gt, s.rate), o, inv_e);
    const V a1 = c.a1.value * inv_e, a2 = c.a2.value * inv_e;
    V g_trace_p = lane_fma(f[0], inv_e, of_basis.volume);
    const V of_volume = (V(T(1)) - c.omega) * third;
    Vec3<V> gd;
    V ge = -(f[0] * s.volumetric);  // dL/d(log e) but for the measures', counted above
    for (int i = 0; i < 3; ++i) {
      const V gw =
          of.aligned * s.rate_frame(i, i) + g_q * v.w[i] * v.inverse_root + f[2] * v.d_cubic[i];
      ge = ge - gw * v.w[i];
      gd[i] = lane_fma(gw, inv_e, of_basis.strain[i]);
      g_trace_p = lane_fma(of_basis.strain[i], of_volume, g_trace_p);
    }

    Mat3<V> G;  // dL/d(U ε̂ Uᵀ) off the diagonal
    for (int k = 0; k < 3; ++k) {
      const int i = kPair[k][0], j = kPair[k][1];
      const V left_out = c.omega * s.h.trace * third;
      const V x = s.h.eps[i] - left_out, y = s.h.eps[j] - left_out;
      const V of_strain = lane_fma(a1, seth_hill_divided_difference(x, y, c.n1),
                                   a2 * seth_hill_divided_difference(x, y, c.n2));
      G(i, j) = G(j, i) = lane_fma(S(i, j), of_strain, of.aligned * s.rate_frame(i, j) * inv_e);
    }
    // A fluid's F_proj is U Σ' Uᵀ = exp(t'/3) I.
    Mat3<V> A =
        tmul(U, mul(load_mat3<V, T>(grad_F_proj, l, count - l, false), select3(g.fluid, U, Vm)));
    const Vec3<V> sigma_p = projected_sigma<V, T>(g, sigma);
    add_strain_gradient(s.h, gd, g_trace_p, A);
    add_symmetric_adjoint(sigma_p, s.h.divided, G, A);

    if (grad_C) {
      Mat3<V> gD = compose(U, v.w, U) * of.aligned + gt * m.viscosity +
                   s.rate * lane_fma(of.rate_norm, s.inverse_rate_root, two * of_basis.rate_square);
      const V mean = trace(gD) * third;
      const V g_rate_trace = lane_fma(of_basis.a0 * third, bulk_viscosity(c), f[3]);
      for (int k = 0; k < 9; k += 4) gD.e[k] = gD.e[k] - mean + g_rate_trace;
      store_mat3<V, T>(grad_C, l, count - l, gD * V(T(kTimeScale)), true);
    }

    // Through the gate, where it is open.
    V g_scale, g_trace;
    Vec3<V> g_dev;
    const Mat3<V> B = log_map_adjoint(strain, sigma, g.map, A, g_scale, g_trace, g_dev);
    // scale = ‖ε̂‖'/‖ε̂‖, ‖ε̂‖' = e (max(c₁, 0) + y(‖ε̂‖/e − max(c₁, 0))) where cut; 1 below the cap.
    const V inv_norm = safe_inverse(strain.norm);
    const V g_new = select<V>(g.cuts_q && !g.fluid, g_scale * inv_norm, zero), g_y = g_new * V(e);
    const V g_c1 = select<V>(g.caps_q, g_y * (V(T(1)) - g.kept.per_excess), zero);
    const V g_c2 = select<V>(g.caps_t, g_trace * V(e), zero);
    const V g_norm = g_new * (g.kept.per_excess - g.scale);
    const V g_viscosity = g_y * g.kept.per_viscosity;
    const V of_flow = g_new * lane_fma(V(e), lane_max(g.cap.c1, zero) + g.kept.value,
                                       -g.kept.per_excess * strain.norm);
    for (int i = 0; i < 3; ++i)
      g_dev[i] =
          select<V>(g.yields, lane_fma(g_norm * inv_norm, strain.deviator[i], g_dev[i]), zero);
    g_trace = select<V>(g.yields && !g.caps_t, g_trace, zero);
    Mat3<V> D = select3(g.yields, B, A);
    D = select3(g.fluid, zero3<V>(), D);
    add_strain_gradient(strain, g_dev, g_trace, D);
    // b̄ = Σ max(σ, floor)²/3, and slope is 1/σ where σ moves it.
    const V g_square = two * third * g_y * g.kept.per_log_factor / g.cap.mean_square;
    for (int i = 0; i < 3; ++i)
      D(i, i) =
          lane_fma(g_square * strain.stretch[i] * strain.stretch[i], strain.slope[i], D(i, i));
    const auto put = [&](CapOutput k, const V& value) {
      store_plane(tile.grad_projection + k * kTile, l, value);
    };
    put(kCap, g_c1);
    put(kTraceCap, g_c2);
    put(kCapSlope, g_c1 * g.cap.per_m);
    put(kCapViscosity, g_viscosity * g.cap.per_viscosity);
    put(kFlowExponent, g_y * g.kept.per_exponent * g.cap.per_exponent);
    // What c₁ owes to t/e directly waits for the network's own part.
    store_plane(tile.grad_direct, l, g_c1 * g.cap.slope);
    sum_cap = sum_cap + g_c2;
    sum_log_e = sum_log_e + ge + of_flow + g_c2 * g.cap.c2;
    for (int k = 0; k < 9; ++k) store_plane(tile.frame + k * kTile, l, D.e[k]);
  }

  T* const invariant = tile.grad_invariants;
  network_backward<T>(law.projection, law.constant_projection, tile.projection_in,
                      tile.projection_tape, tile.grad_projection, invariant,
                      {accumulator, in(accumulator, law.cap_sums()), weight_sums,
                       in(weight_sums, law.projection_feature_sums())});
  for (std::ptrdiff_t l = 0; l < kTile; l += w) {
    const Mat3<V> U = load_plane3<V>(tile.U, l), Vm = load_plane3<V>(tile.V, l);
    Vec3<V> sigma;
    for (int k = 0; k < 3; ++k) sigma[k] = V::load_aligned(tile.sigma + k * kTile + l);
    const HenckyStrain<V> strain = hencky_strain(sigma, true);
    const StrainInvariants<V> v = strain_invariants(strain, inv_e);
    const V gt = V::load_aligned(invariant + l) + V::load_aligned(tile.grad_direct + l);
    const V gq = V::load_aligned(invariant + kTile + l);
    const V gl = V::load_aligned(invariant + 2 * kTile + l);
    sum_log_e = sum_log_e - gt * strain.trace * inv_e;
    Vec3<V> gd;
    for (int i = 0; i < 3; ++i) {
      const V gw = lane_fma(gl, v.d_cubic[i], gq * v.w[i] * v.inverse_root);
      sum_log_e = sum_log_e - gw * v.w[i];
      gd[i] = gw * inv_e;
    }
    Mat3<V> D = load_plane3<V>(tile.frame, l);
    add_strain_gradient(strain, gd, gt * inv_e, D);
    if (grad_F_trial && l < count)
      store_mat3<V, T>(grad_F_trial, l, count - l, mult(mul(U, D), Vm));
  }
  if (accumulator) {
    T* tail = accumulator + law.scale_sums();
    tail[0] += lane_sum(sum_log_s);
    tail[1] += lane_sum(sum_log_e);
    tail[2] -= lane_sum(sum_rest);
    tail[3] -= lane_sum(sum_cap);
  }
}

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
