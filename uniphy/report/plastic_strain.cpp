#include "uniphy/report/plastic_strain.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace uniphy {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Cell = std::array<std::int64_t, 3>;

Vector3d point(const std::vector<double>& x, std::int32_t p) {
  return Eigen::Map<const Vector3d>(x.data() + 3 * std::ptrdiff_t(p));
}

Matrix3d gradient(const std::vector<double>& F, std::size_t p) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(F.data() + 9 * p);
}

/// Twice the distance of neighbours, from the box around them: some eight particles a cell.
double cell_size(const std::vector<double>& x, const std::vector<std::int32_t>& particles) {
  Vector3d low = Vector3d::Constant(1e300), high = -low;
  for (const std::int32_t p : particles) {
    low = low.cwiseMin(point(x, p));
    high = high.cwiseMax(point(x, p));
  }
  const double volume = (high - low).cwiseMax(1e-6).prod();
  return 2 * std::cbrt(volume / static_cast<double>(particles.size()));
}

double equivalent_strain(const Matrix3d& plastic) {
  Eigen::SelfAdjointEigenSolver<Matrix3d> solver;  // in closed form, to 1e-7 or so
  solver.computeDirect(plastic.transpose() * plastic, Eigen::EigenvaluesOnly);
  const Vector3d strain = 0.5 * solver.eigenvalues().array().max(1e-12).log();
  const Vector3d deviator = strain.array() - strain.mean();
  return std::sqrt(2.0 / 3.0) * deviator.norm();
}

}  // namespace

PlasticStrain::PlasticStrain(const std::vector<double>& x, const std::vector<double>& F,
                             const std::vector<std::int32_t>& body)
    : x_(x), particles_(body.size()) {
  std::map<std::int32_t, std::vector<std::int32_t>> bodies;
  for (std::size_t p = 0; p < body.size(); ++p) {
    particles_[p].elastic = gradient(F, p);
    if (std::isfinite(point(x, std::int32_t(p)).sum())) {
      bodies[body[p]].push_back(static_cast<std::int32_t>(p));
    }
  }
  for (const auto& [unused, of_body] : bodies) add_neighbours(x, of_body);
  for (std::size_t p = 0; p < particles_.size(); ++p) {
    Particle& particle = particles_[p];
    Matrix3d sum = Matrix3d::Zero();
    for (const std::int32_t q : particle.neighbours) {
      const Vector3d d = point(x, q) - point(x, static_cast<std::int32_t>(p));
      sum += d * d.transpose();
    }
    const double scale = sum.trace() / 3;
    particle.whole = sum.determinant() > 1e-3 * scale * scale * scale;
    if (particle.whole) particle.inverse = sum.inverse();
  }
}

void PlasticStrain::add_neighbours(const std::vector<double>& x,
                                   const std::vector<std::int32_t>& of_body) {
  const double size = cell_size(x, of_body);
  const auto cell_of = [&](std::int32_t p) {
    Cell cell;
    for (int k = 0; k < 3; ++k) cell[k] = std::int64_t(std::floor(point(x, p)[k] / size));
    return cell;
  };
  std::map<Cell, std::vector<std::int32_t>> cells;
  for (const std::int32_t p : of_body) cells[cell_of(p)].push_back(p);
  std::vector<std::pair<double, std::int32_t>> near;
  for (const std::int32_t p : of_body) {
    near.clear();
    const Cell c = cell_of(p);
    for (int i = 0; i < 27; ++i) {
      const auto at = cells.find({c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1});
      if (at == cells.end()) continue;
      for (const std::int32_t q : at->second) {
        if (q != p) near.emplace_back((point(x, q) - point(x, p)).squaredNorm(), q);
      }
    }
    const auto count = std::min<std::size_t>(near.size(), kNeighbours);
    std::partial_sort(near.begin(), near.begin() + std::ptrdiff_t(count), near.end());
    for (std::size_t i = 0; i < count; ++i) particles_[p].neighbours.push_back(near[i].second);
  }
}

std::vector<float> PlasticStrain::at(const std::vector<double>& x,
                                     const std::vector<double>& F) const {
  std::vector<float> strain(particles_.size(), std::numeric_limits<float>::quiet_NaN());
  for (std::size_t p = 0; p < particles_.size(); ++p) {
    const Particle& particle = particles_[p];
    const Matrix3d elastic = gradient(F, p);
    if (!particle.whole || !(std::abs(elastic.determinant()) > 1e-9)) continue;
    const auto self = static_cast<std::int32_t>(p);
    Matrix3d moved = Matrix3d::Zero();
    for (const std::int32_t q : particle.neighbours) {
      moved += (point(x, q) - point(x, self)) * (point(x_, q) - point(x_, self)).transpose();
    }
    const Matrix3d whole = moved * particle.inverse;
    const double value = equivalent_strain(elastic.inverse() * whole * particle.elastic);
    strain[p] = static_cast<float>(value);
  }
  return strain;
}

}  // namespace uniphy
