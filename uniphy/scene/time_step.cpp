#include "uniphy/scene/time_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace uniphy {
namespace {

// τ₁₁ of F = (1 − pressed) diag(1 − strain, 1, 1), C = diag(rate, 0, 0).
double stress(const kernels::LawKernel<double>& law, double pressed, double strain, double rate) {
  const double side = 1 - pressed;
  double F[9] = {side * (1 - strain), 0, 0, 0, side, 0, 0, 0, side};
  const double C[9] = {rate, 0, 0, 0, 0, 0, 0, 0, 0};
  double F_proj[9], tau[9];
  const double dt = 1e-4;  // s, only viscoplastic flow depends on it
  law.evaluate(1, dt, {F, 9, 1}, {C, 9, 1}, {F_proj, 9, 1}, {tau, 9, 1});
  return tau[0];
}

}  // namespace

Stiffness estimate_stiffness(const kernels::LawDescription& description) {
  const auto law = kernels::make_law<double>(description);
  const double rest = stress(*law, 0, 0, 0);
  Stiffness stiffness;
  for (const double strain : {1e-4, 1e-3, 1e-2}) {
    const double modulus = std::abs(stress(*law, 0, strain, 0) - rest) / strain;
    stiffness.wave_modulus = std::max(stiffness.wave_modulus, modulus);
  }
  // Sand flows under the slightest uniaxial strain; under pressure it is as stiff as it gets.
  const double pressed = 1e-3, strain = 1e-5;
  const double tangent =
      std::abs(stress(*law, pressed, strain, 0) - stress(*law, pressed, 0, 0)) / strain;
  stiffness.wave_modulus = std::max(stiffness.wave_modulus, tangent);
  std::vector<double> rates{1, -1};
  // A fluid that thickens is stiffest where it is sheared fastest: an impact of 10 m/s, a cell of
  // a centimetre.
  if (description.id == kernels::LawId::carreau) rates.push_back(1e3);
  for (const double rate : rates) {
    const double viscosity = std::abs(stress(*law, 0, 0, rate) - rest) / std::abs(rate);
    stiffness.viscosity = std::max(stiffness.viscosity, viscosity);
  }
  return stiffness;
}

double stable_time_step(const Stiffness& stiffness, double density, double dx, double speed,
                        double safety) {
  const double sound = std::sqrt(stiffness.wave_modulus / density);
  const double wave = dx / (sound + 3 * speed);
  const double viscous = stiffness.viscosity > 0 ? density * dx * dx / (6 * stiffness.viscosity)
                                                 : std::numeric_limits<double>::infinity();
  return safety * std::min(wave, viscous);
}

double round_time_step(double dt) {
  // Divided by a whole power of ten rather than multiplied by its inverse: the nearest number to
  // the short decimal.
  const double power = std::pow(10.0, 1 - std::floor(std::log10(dt)));
  return std::floor(dt * power * (1 + 1e-12)) / power;
}

}  // namespace uniphy
