#include "uniphy/data/random_law.hpp"

#include <algorithm>
#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/spectral/spectral.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using Mat3 = kernels::Mat3<double>;
using Svd3 = kernels::Svd3<double>;

constexpr double kLeastVolume = 1e-6;  ///< as newtonian

Mat3 load(const double* from) {
  Mat3 m;
  std::copy_n(from, 9, m.e);
  return m;
}

kernels::Vec3<double> lanes(const Vector3d& v) { return {{v[0], v[1], v[2]}}; }

Vector3d hencky(const Svd3& svd) {
  const auto strain = kernels::hencky_strain(svd.sigma, false);
  return {strain.eps[0], strain.eps[1], strain.eps[2]};
}

/// dev sym C.
Mat3 deviatoric_rate(const Mat3& D) {
  return D - kernels::identity3<double>() * (kernels::trace(D) / 3);
}

void evaluate_fluid(const RandomLaw& law, const Mat3& F, const Mat3& C, double* F_proj,
                    double* tau) {
  const double J = std::max(kernels::determinant(F), kLeastVolume);
  const Mat3 D = kernels::sym(C), shear = deviatoric_rate(D);
  const double rate = std::sqrt(2 * kernels::dot(shear, shear));
  const Mat3 viscous = (law.whole_rate ? D : shear) * (2 * law.viscosity(rate));
  const Mat3 identity = kernels::identity3<double>();
  const Mat3 stress = identity * law.elasticity.state.stress(std::log(J)) + viscous;
  std::copy_n((identity * std::cbrt(J)).e, 9, F_proj);
  std::copy_n(stress.e, 9, tau);
}

}  // namespace

const char* random_law_name(RandomLawKind kind) {
  constexpr std::array<const char*, 3> kNames{"random_solid", "random_fluid", "random_plastic"};
  return kNames.at(static_cast<std::size_t>(kind));
}

bool is_random_law(const std::string& material) {
  return std::any_of(kRandomLawKinds.begin(), kRandomLawKinds.end(),
                     [&](RandomLawKind kind) { return material == random_law_name(kind); });
}

void RandomLaw::evaluate(double dt, const double* F, const double* C, double* F_proj,
                         double* tau) const {
  if (kind == RandomLawKind::fluid) return evaluate_fluid(*this, load(F), load(C), F_proj, tau);
  const Svd3 svd = kernels::svd3(load(F));
  const Vector3d trial = hencky(svd);
  const Vector3d eps = kind == RandomLawKind::plastic ? yield.project(trial, dt) : trial;
  if (eps == trial) {
    std::copy_n(F, 9, F_proj);
  } else {
    const Vector3d stretch = eps.array().exp();
    std::copy_n(kernels::compose(svd.U, lanes(stretch), svd.V_).e, 9, F_proj);
  }
  std::copy_n(kernels::compose(svd.U, lanes(elasticity.stress(eps)), svd.U).e, 9, tau);
}

}  // namespace uniphy
