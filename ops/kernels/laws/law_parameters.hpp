#pragma once

#include <array>
#include <limits>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/laws/law_table.hpp"

// The parameters of the analytic laws in one table, by which configurations, files, fits and tests
// name, read and describe them.

namespace uniphy::kernels {

/// One parameter. Its values are finite numbers from 0 on, below `below`.
struct LawParameter {
  int place;         ///< in kLawParameterTable, in LawParameters and in every file
  const char* name;  ///< in YAML, HDF5, CSV and messages
  double LawDescription::*member;
  const char* unit;
  const char* text;  ///< what it is, for descriptions of keys
  bool positive;     ///< 0 itself is no value
  double below = std::numeric_limits<double>::infinity();
};

inline constexpr std::array<LawParameter, kLawParameters> kLawParameterTable{
    {{0, "mu", &LawDescription::mu, "Pa", "shear modulus", true},
     {1, "lambda", &LawDescription::lambda, "Pa", "first Lame parameter", true},
     {2, "tau_y", &LawDescription::tau_y, "Pa", "yield stress", false},
     {3, "theta", &LawDescription::theta, "rad", "friction angle", false, 1.5707963267948966},
     {4, "eta", &LawDescription::eta, "Pa s", "viscosity of the plastic flow", false},
     {5, "c1", &LawDescription::c1, "Pa", "first Mooney-Rivlin modulus", true},
     {6, "c2", &LawDescription::c2, "Pa", "second Mooney-Rivlin modulus", false},
     {7, "eta_inf", &LawDescription::eta_inf, "Pa s", "viscosity at a high rate of shear", false},
     {8, "kappa", &LawDescription::kappa, "s", "time scale of the change of viscosity", false},
     {9, "n", &LawDescription::n, "1", "flow index; below 1: thins with the rate", true},
     {10, "cohesion", &LawDescription::cohesion, "1", "volumetric strain at which it tears",
      false}}};

/// Those of a law, in the order of its gradient, with the units and texts that they have there (mu
/// of newtonian is a viscosity); none for learned.
const std::vector<LawParameter>& law_parameters(LawId id);

/// The numbers that a law is conditioned on, in the order of LawKernel::parameter_gradient: its
/// parameters, the latent z of a learned one (as long as its weights say, where it has them).
/// with_parameters takes as many from `values`.
std::ptrdiff_t parameter_count(const LawDescription& law);
std::vector<double> parameter_values(const LawDescription& law);
LawDescription with_parameters(LawDescription law, const double* values);

/// The parameters as the kernels take them.
template <class T>
LawParameters<T> kernel_parameters(const LawDescription& law) {
  LawParameters<T> parameters;
  for (const LawParameter& p : kLawParameterTable)
    parameters.*kLawParameterMembers<T>[p.place] = T(law.*p.member);
  return parameters;
}

}  // namespace uniphy::kernels
