#include "uniphy/scene/law_origin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace uniphy {

bool flows_by_steps(const kernels::LawDescription& law) {
  if (law.id != kernels::LawId::learned || law.weights->form == kernels::LawForm::isotropic)
    return false;
  const auto kernel = kernels::make_law<double>(law);
  constexpr double kDt = 1e-4;  // s; the published form does not see it
  constexpr double kRest[9] = {};
  for (const double strain : {0.003, 0.01, 0.03, 0.1, 0.2}) {
    for (const double sign : {-1.0, 1.0}) {
      // Stretched along x at constant volume.
      const double along = std::exp(sign * strain), across = std::exp(-0.5 * sign * strain);
      const double F[9] = {along, 0, 0, 0, across, 0, 0, 0, across};
      double once[9], twice[9], tau[9];
      kernel->evaluate(1, kDt, {F, 9, 1}, {kRest, 9, 1}, {once, 9, 1}, {tau, 9, 1});
      kernel->evaluate(1, kDt, {once, 9, 1}, {kRest, 9, 1}, {twice, 9, 1}, {tau, 9, 1});
      const double first = std::abs(once[0] - F[0]), second = std::abs(twice[0] - once[0]);
      // A trained return to a surface misses it by up to a few per cent, on either side.
      if (first > 1e-6 && second > 0.1 * first) return true;
    }
  }
  return false;
}

double nearest_step(const std::array<double, 2>& range, double dt) {
  return std::clamp(dt, range[0], range[1]);
}

double step_factor(const std::array<double, 2>& range, double dt) {
  if (!(range[0] > 0)) return 1;
  const double near = nearest_step(range, dt);
  return std::max(dt / near, near / dt);
}

std::optional<std::string> time_step_warning(const kernels::LawDescription& law,
                                             const LawOrigin& origin, double dt) {
  const double factor = step_factor(origin.dt, dt);
  // One part in 1e9: steps are written and read as decimals.
  if (factor <= kStepOfFlow * (1 + 1e-9)) return {};
  const bool fitted = origin.kind == LawOrigin::Kind::fitted;
  const double own = nearest_step(origin.dt, dt);
  const std::string steps = fmt::format(
      "its law was {} at a time step of {:.3g} s, and here dt is "
      "{:.3g} s",
      fitted ? "fitted" : "trained", own, dt);
  if (flows_by_steps(law)) {
    return fmt::format(
        "{}: it flows by a share of what exceeds its yield strain in every step, so that its "
        "viscosity comes out {:.2g} times as large; expected dt = {:.3g} s",
        steps, dt / own, own);
  }
  if (fitted && factor > kStepOfFit * (1 + 1e-9)) {
    return fmt::format(
        "{}: the transfer between particles and grid damps at every step, so that bodies move "
        "otherwise than in the fit; expected dt within a factor of {:g}",
        steps, kStepOfFit);
  }
  return {};
}

}  // namespace uniphy
