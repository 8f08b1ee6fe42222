#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "tests/support/matrix_math.hpp"

namespace uniphy::testing {

/// One deformation gradient of the gradient table, F = U diag(sigma) Vᵀ with random rotations.
struct DeformationCase {
  std::string group;  ///< row of the table
  Matrix sigma;
  Matrix F;
  double step;  ///< of central differences that stay on one side of every kink
};

/// Singular values with every gap that the divided differences must bear, near-singular, singular
/// and inverted; in compression and in tension.
inline std::vector<DeformationCase> deformation_cases(unsigned seed = 11) {
  std::mt19937_64 random(seed);
  std::vector<DeformationCase> cases;
  const auto add = [&](const std::string& group, double a, double b, double c, double step) {
    const Matrix s = diagonal(a, b, c);
    cases.push_back(
        {group, s, composed(random_rotation(random), s, random_rotation(random)), step});
  };
  for (const auto& [name, gap] : {std::pair<const char*, double>{"gap 0", 0},
                                  {"gap 1e-12", 1e-12},
                                  {"gap 1e-8", 1e-8},
                                  {"gap 1e-4", 1e-4},
                                  {"gap 1", 1}}) {
    for (const double b : {0.7, 1.15}) {
      add(name, b + 2 * gap, b + gap, b, 1e-5);              // all three meet
      add(name, b + gap, b, 0.5 * b, 1e-5);                  // the upper pair
      add(name, 2 * b + gap, 0.8 * b + gap, 0.8 * b, 1e-5);  // the lower pair
    }
  }
  add("sigma3 = 1e-3", 1.2, 0.8, 1e-3, 1e-7);
  add("sigma3 = 1e-3", 0.7, 0.7, 1e-3, 1e-7);
  add("inverted", 1.3, 0.9, -0.4, 1e-5);
  add("inverted", 0.8, 0.8, -1e-3, 1e-7);
  cases.push_back({"F = I", identity(), identity(), 1e-5});
  return cases;
}

/// Whether the smallest singular value is below the clamp of the logarithm. A law with memory jumps
/// there where it leaves 0.
inline bool is_clamped(const DeformationCase& c) {
  return c.group == "sigma3 = 1e-3" || c.group == "inverted";
}

/// Parameters for the tests of one law; with them the cases above stand on both sides of its yield
/// surface.
inline kernels::LawDescription sample_law(kernels::LawId id) {
  kernels::LawDescription d;
  d.id = id;
  d.mu = id == kernels::LawId::newtonian ? 300 : 1e5;
  d.lambda = 2e5;
  d.tau_y = 7e3;
  d.theta = 0.35;
  d.eta = id == kernels::LawId::carreau ? 200 : 5;
  d.c1 = 8e4;
  d.c2 = 2e4;
  d.eta_inf = 20;
  d.kappa = 0.4;
  d.n = id == kernels::LawId::carreau ? 0.4 : 0.7;
  d.cohesion = 0.02;
  return d;
}

inline const std::vector<kernels::LawId>& analytic_laws() {
  using kernels::LawId;
  static const std::vector<LawId> all{LawId::elastic,       LawId::newtonian,
                                      LawId::plasticine,    LawId::sand,
                                      LawId::non_newtonian, LawId::fixed_corotated,
                                      LawId::water,         LawId::volume_corrected_sand,
                                      LawId::mooney_rivlin, LawId::carreau,
                                      LawId::cohesive_sand, LawId::herschel_bulkley};
  return all;
}
inline std::vector<kernels::LawId> laws_without_memory() {
  std::vector<kernels::LawId> all = analytic_laws();
  all.erase(std::remove_if(all.begin(), all.end(), kernels::law_has_memory), all.end());
  return all;
}

/// Whether the stress depends on C.
inline bool is_viscous_fluid(kernels::LawId id) {
  return id == kernels::LawId::newtonian || id == kernels::LawId::carreau;
}
inline bool is_fluid(kernels::LawId id) {
  return is_viscous_fluid(id) || id == kernels::LawId::water;
}
inline bool is_sand(kernels::LawId id) {
  using kernels::LawId;
  return id == LawId::sand || id == LawId::volume_corrected_sand || id == LawId::cohesive_sand;
}
/// Whether the flow depends on the time step.
inline bool is_rate_dependent(kernels::LawId id) {
  return id == kernels::LawId::non_newtonian || id == kernels::LawId::herschel_bulkley;
}
inline bool is_plastic(kernels::LawId id) {
  using kernels::LawId;
  return id == LawId::plasticine || is_sand(id) || is_rate_dependent(id);
}

/// F with deviatoric strain of norm q and trace t, in a random frame.
inline Matrix strained(double q, double t, std::mt19937_64& random) {
  std::uniform_real_distribution<double> angle(0, 6.283185307179586);
  const double a = angle(random), c = std::sqrt(2.0 / 3) * q, third = 2.0943951023931953;
  const Matrix s =
      diagonal(std::exp(c * std::cos(a) + t / 3), std::exp(c * std::cos(a - third) + t / 3),
               std::exp(c * std::cos(a + third) + t / 3));
  return composed(random_rotation(random), s, random_rotation(random));
}

/// The norm of the deviatoric strain at which a plastic law yields at trace t.
inline double yield_norm(const kernels::LawDescription& d, double t) {
  if (!is_sand(d.id)) return d.tau_y / (2 * d.mu);
  const double s = std::sin(d.theta), alpha = std::sqrt(2.0 / 3) * 2 * s / (3 - s);
  const double apex = d.id == kernels::LawId::cohesive_sand ? d.cohesion : 0;
  return -alpha * (3 * d.lambda + 2 * d.mu) / (2 * d.mu) * (t - apex);
}

/// The cases that one law is differentiated at: all of the above, and either side of its yield
/// surface. Sand has its tip at F = I, where no derivative exists.
inline std::vector<DeformationCase> cases_of(const kernels::LawDescription& d) {
  std::vector<DeformationCase> cases = deformation_cases();
  if (is_sand(d.id) && d.id != kernels::LawId::cohesive_sand) cases.pop_back();
  std::mt19937_64 random(47);
  for (const auto& [name, off] :
       {std::pair<const char*, double>{"yield - 0.3 %", -3e-3}, {"yield + 0.3 %", 3e-3}}) {
    for (int i = 0; is_plastic(d.id) && i < 5; ++i) {
      const Matrix F = strained(yield_norm(d, -0.05) * (1 + off), -0.05, random);
      cases.push_back({name, Matrix{}, F, 2e-6});
    }
  }
  return cases;
}

}  // namespace uniphy::testing
