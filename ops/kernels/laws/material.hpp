#pragma once

#include "ops/kernels/laws/law_table.hpp"
#include "ops/kernels/simd/mat3.hpp"

namespace uniphy::kernels {
inline namespace UNIPHY_ISA {

/// The parameters of a law broadcast to lanes, with what depends on them alone.
template <class V>
struct Material {
  V mu, lambda, tau_y, eta, dt;
  V sin_theta, cos_theta;

  template <class T>
  UNIPHY_INLINE Material(const LawParameters<T>& p, T time_step)
      : mu(p.mu),
        lambda(p.lambda),
        tau_y(p.tau_y),
        eta(p.eta),
        dt(time_step),
        sin_theta(T(::sin(static_cast<double>(p.theta)))),
        cos_theta(T(::cos(static_cast<double>(p.theta)))) {}
};

/// dL/d(parameters), one running sum per lane.
template <class V>
struct MaterialGradient {
  V mu, lambda, tau_y, theta, eta;

  UNIPHY_INLINE MaterialGradient()
      : mu(ScalarOf<V>(0)),
        lambda(ScalarOf<V>(0)),
        tau_y(ScalarOf<V>(0)),
        theta(ScalarOf<V>(0)),
        eta(ScalarOf<V>(0)) {}

  template <class T>
  UNIPHY_INLINE void add_to(LawParameters<T>* total) const {
    if (total == nullptr) return;
    total->mu += lane_sum(mu);
    total->lambda += lane_sum(lambda);
    total->tau_y += lane_sum(tau_y);
    total->theta += lane_sum(theta);
    total->eta += lane_sum(eta);
  }
};

}  // namespace UNIPHY_ISA
}  // namespace uniphy::kernels
