#include "uniphy/stability/dissipation.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

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

/// Works with the sizes of what does them.
struct Works {
  std::vector<double> work;
  double forces = 0, flows = 0;  ///< sums of squares

  void add(const Matrix& force, const Matrix& flow, const Matrix& whole_force,
           const Matrix& whole_flow) {
    work.push_back(force.cwiseProduct(flow).sum());
    forces += whole_force.squaredNorm();
    flows += whole_flow.squaredNorm();
  }
  /// The least in units of the sizes, and which; NaN where one is not finite.
  std::pair<double, std::int64_t> least() const {
    const double unit = std::sqrt(forces * flows) / static_cast<double>(work.size());
    std::size_t at = 0;
    for (std::size_t i = 0; i < work.size(); ++i) {
      if (!(work[i] >= work[at])) at = i;
    }
    return {work[at] / unit, static_cast<std::int64_t>(at)};
  }
};

}  // namespace

Dissipation least_dissipation(const kernels::LawDescription& description, std::int64_t count,
                              std::uint64_t seed) {
  const auto law = kernels::make_law<double>(description);
  const double dt = 2e-4;
  UniformRandom random(seed);
  Works plastic, viscous;
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
    const Matrix strain_tensor = hencky_strain(F), rate = 0.5 * (C + C.transpose());
    plastic.add(tau, strain_tensor - hencky_strain(projected), tau, strain_tensor);
    viscous.add(moving - tau, rate, moving, rate);
  }
  Dissipation least;
  std::tie(least.plastic, least.plastic_state) = plastic.least();
  std::tie(least.viscous, least.viscous_state) = viscous.least();
  return least;
}

}  // namespace uniphy::stability
