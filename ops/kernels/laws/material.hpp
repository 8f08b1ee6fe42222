#pragma once

#include "ops/kernels/laws/law_table.hpp"
#include "ops/kernels/simd/mat3.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// The parameters of a law broadcast to lanes, with what depends on them alone.
template <class V>
struct Material {
  V mu, lambda, tau_y, eta, c1, c2, eta_inf, kappa, n, cohesion, dt;
  V sin_theta, cos_theta;

  template <class T>
  UNIPHY_INLINE Material(const LawParameters<T>& p, T time_step)
      : mu(p.mu),
        lambda(p.lambda),
        tau_y(p.tau_y),
        eta(p.eta),
        c1(p.c1),
        c2(p.c2),
        eta_inf(p.eta_inf),
        kappa(p.kappa),
        n(p.n),
        cohesion(p.cohesion),
        dt(time_step),
        sin_theta(T(::sin(static_cast<double>(p.theta)))),
        cos_theta(T(::cos(static_cast<double>(p.theta)))) {}
};

/// dL/d(parameters), one running sum per lane.
template <class V>
struct MaterialGradient {
  V mu, lambda, tau_y, theta, eta, c1, c2, eta_inf, kappa, n, cohesion;

  UNIPHY_INLINE MaterialGradient() {
    for (V* sum : {&mu, &lambda, &tau_y, &theta, &eta, &c1, &c2, &eta_inf, &kappa, &n, &cohesion})
      *sum = V(ScalarOf<V>(0));
  }

  template <class T>
  UNIPHY_INLINE void add_to(LawParameters<T>* total) const {
    if (total == nullptr) return;
    total->mu += lane_sum(mu);
    total->lambda += lane_sum(lambda);
    total->tau_y += lane_sum(tau_y);
    total->theta += lane_sum(theta);
    total->eta += lane_sum(eta);
    total->c1 += lane_sum(c1);
    total->c2 += lane_sum(c2);
    total->eta_inf += lane_sum(eta_inf);
    total->kappa += lane_sum(kappa);
    total->n += lane_sum(n);
    total->cohesion += lane_sum(cohesion);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
