#include "uniphy/data/random_elasticity.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace uniphy {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// (exp(n x) − 1)/n, x where n = 0.
double measure(double x, double n) { return n == 0 ? x : std::expm1(n * x) / n; }

Vector3d deviator(const Vector3d& v) { return v.array() - v.mean(); }

Vector3d term_stress(const ElasticTerm& term, const Vector3d& eps) {
  const double scale = 2 * term.modulus, n = term.exponent;
  const Vector3d dev = deviator(eps);
  switch (term.measure) {
    case ElasticTerm::Measure::isochoric:
      return scale * deviator(dev.unaryExpr([n](double e) { return measure(e, n); }));
    case ElasticTerm::Measure::whole:
      return scale * eps.unaryExpr([n](double e) { return measure(e, n); });
    case ElasticTerm::Measure::stiffening:
      break;
  }
  return scale * std::exp(n * dev.squaredNorm()) * dev;
}

/// The eigenvalues of the symmetric part of ∂τ/∂ε, increasing, by central differences.
Vector3d tangent_eigenvalues(const RandomElasticity& law, const Vector3d& eps) {
  constexpr double kStep = 1e-5;  // of strain: truncation and rounding both near 1e-10
  Matrix3d tangent;
  for (int j = 0; j < 3; ++j) {
    const Vector3d step = kStep * Vector3d::Unit(j);
    tangent.col(j) = (law.stress(eps + step) - law.stress(eps - step)) / (2 * kStep);
  }
  const Matrix3d symmetric = 0.5 * (tangent + tangent.transpose());
  return Eigen::SelfAdjointEigenSolver<Matrix3d>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

ElasticTerm draw_term(UniformRandom& random) {
  ElasticTerm term;
  const double kind = random.unit();
  if (kind < 0.45) {
    term.measure = ElasticTerm::Measure::isochoric;
  } else if (kind < 0.85) {
    term.measure = ElasticTerm::Measure::whole;
  } else {
    term.measure = ElasticTerm::Measure::stiffening;
  }
  // Rubbers are fitted with Ogden exponents from −4 to 8, most of them between −2 and 4; at a
  // strain of 0.5 a factor exp(4 · 0.25) is a solid that stiffens three times.
  term.exponent = term.measure == ElasticTerm::Measure::stiffening ? random.log_between(0.3, 8)
                  : random.unit() < 0.75                           ? random.between(-2, 4)
                                                                   : random.between(-4, 8);
  return term;
}

}  // namespace

double EquationOfState::stress(double log_J) const {
  return modulus * std::exp(b * log_J) * measure(log_J, a - b);
}

bool EquationOfState::stable(double log_J) const {
  constexpr double kStep = 1e-5;  // as tangent_eigenvalues
  const double tangent = (stress(log_J + kStep) - stress(log_J - kStep)) / (2 * kStep);
  return tangent >= kLeastTangent * modulus && tangent <= kLargestTangent * modulus;
}

Vector3d RandomElasticity::stress(const Vector3d& eps) const {
  Vector3d tau = Vector3d::Constant(state.stress(eps.sum()));
  for (const ElasticTerm& term : terms) tau += term_stress(term, eps);
  return tau;
}

double RandomElasticity::shear_modulus() const {
  double sum = 0;
  for (const ElasticTerm& term : terms) sum += term.modulus;
  return sum;
}

bool RandomElasticity::stable(const std::vector<Vector3d>& strains) const {
  const Vector3d rest = tangent_eigenvalues(*this, Vector3d::Zero());
  if (!(rest[0] > 0)) return false;
  for (const Vector3d& eps : strains) {
    const Vector3d here = tangent_eigenvalues(*this, eps);
    // Written so that NaN fails too.
    if (!(here[0] >= kLeastTangent * rest[0] && here[2] <= kLargestTangent * rest[2])) return false;
  }
  return true;
}

EquationOfState draw_equation_of_state(double modulus, bool liquid, UniformRandom& random) {
  const double kind = random.unit(), u = random.unit(), v = random.unit();
  if (kind < 0.2) return {modulus, 0, 0};
  if (kind < 0.35) return {modulus, 2, 0};
  if (kind < 0.5 && !liquid) return {modulus, 2, 1};
  if (kind < 0.75) return {modulus, 1, 1 - std::exp(std::log(8.0) * u)};  // Tait, n from 1 to 8
  const double a = 0.5 + 2.5 * u;
  return {modulus, a, a - 0.5 - (a + 5.5) * v};  // b from −6 to a − 1/2
}

RandomElasticity draw_elasticity(double mu, double lambda, UniformRandom& random) {
  RandomElasticity law;
  const std::size_t count = 1 + random.below(3);
  double positive = 0;
  for (std::size_t k = 0; k < count; ++k) {
    law.terms.push_back(draw_term(random));
    law.terms.back().modulus = random.between(0.1, 1);
    positive += law.terms.back().modulus;
  }
  // The difference of two measures, as in a corotated solid (2 and -1 times its modulus), is a term
  // below zero that the others make up for.
  double& first = law.terms.front().modulus;
  if (count > 1 && random.unit() < 0.5) {
    const double others = positive - first;
    first = -random.log_between(0.1, 1.5);
    for (std::size_t k = 1; k < count; ++k) law.terms[k].modulus *= (1 - first) / others;
    positive = 1;
  }
  for (ElasticTerm& term : law.terms) term.modulus *= mu / positive;
  // Whole terms bring 2/3 of their shear modulus as a bulk modulus of their own.
  double isochoric = 0;
  for (const ElasticTerm& term : law.terms)
    if (term.measure != ElasticTerm::Measure::whole) isochoric += term.modulus;
  law.state = draw_equation_of_state(lambda + 2.0 / 3 * std::max(0.0, isochoric), false, random);
  return law;
}

RandomElasticity hencky_elasticity(double mu, double lambda) {
  return {{{ElasticTerm::Measure::whole, mu, 0}}, {lambda, 0, 0}};
}

}  // namespace uniphy
