#include "uniphy/stability/dissipation.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include "uniphy/geometry/random.hpp"

namespace uniphy::stability {
namespace {

using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Matrix random_rotation(UniformRandom& random) {
  const Eigen::Vector3d axis = random.direction();
  return Eigen::AngleAxisd(random.between(-3.1, 3.1), axis).toRotationMatrix();
}

/// ½ log F Fᵀ
Matrix hencky_strain(const Matrix& F) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(Eigen::Matrix3d(F * F.transpose()));
  const Eigen::Vector3d values = 0.5 * solver.eigenvalues().array().max(1e-12).log();
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

/// Flows of less than rounding of the strain count as none.
double cosine(const Matrix& force, const Matrix& flow) {
  const double size = force.norm() * flow.norm();
  if (!std::isfinite(size)) return std::nan("");
  return flow.norm() > 1e-9 && force.norm() > 1e-9 ? (force.cwiseProduct(flow)).sum() / size : 1;
}

}  // namespace

Dissipation least_dissipation(const kernels::LawDescription& description, std::int64_t count,
                              std::uint64_t seed) {
  const auto law = kernels::make_law<double>(description);
  const double dt = 2e-4;
  UniformRandom random(seed);
  Dissipation least{1, 1, 0, 0};
  for (std::int64_t i = 0; i < count; ++i) {
    const Matrix U = random_rotation(random), V = random_rotation(random);
    const Eigen::Vector3d strain =
        random.in_box(Eigen::Vector3d::Constant(-0.3), Eigen::Vector3d::Constant(0.3));
    const Matrix F = U * Eigen::Vector3d(strain.array().exp()).asDiagonal() * V.transpose();
    Matrix C;
    for (int k = 0; k < 9; ++k) C.data()[k] = random.between(-10, 10);
    const Matrix rest = Matrix::Zero();
    Matrix projected, tau, moving, ignored;
    const auto evaluate = [&](const Matrix& rate, Matrix& F_proj, Matrix& stress) {
      law->evaluate(1, dt, {F.data(), 9, 1}, {rate.data(), 9, 1}, {F_proj.data(), 9, 1},
                    {stress.data(), 9, 1});
    };
    evaluate(rest, projected, tau);
    evaluate(C, ignored, moving);
    const double plastic = cosine(tau, hencky_strain(F) - hencky_strain(projected));
    const double viscous = cosine(moving - tau, 0.5 * (C + C.transpose()));
    if (!(plastic >= least.plastic)) {
      least.plastic = plastic;
      least.plastic_state = i;
    }
    if (!(viscous >= least.viscous)) {
      least.viscous = viscous;
      least.viscous_state = i;
    }
  }
  return least;
}

}  // namespace uniphy::stability
