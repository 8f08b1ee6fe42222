#include "ops/kernels/laws/law_parameters.hpp"

#include <initializer_list>

namespace uniphy::kernels {
namespace {

using D = LawDescription;

std::vector<LawParameter> table_rows(std::initializer_list<double D::*> members) {
  std::vector<LawParameter> rows;
  for (double D::*const member : members) {
    for (const LawParameter& p : kLawParameterTable) {
      if (p.member == member) rows.push_back(p);
    }
  }
  return rows;
}

std::vector<LawParameter> viscous_fluid() {
  std::vector<LawParameter> rows = table_rows({&D::mu, &D::lambda});
  rows[0].unit = "Pa s";
  rows[0].text = "dynamic viscosity";
  return rows;
}

std::vector<LawParameter> inviscid_fluid() {
  std::vector<LawParameter> rows = table_rows({&D::lambda});
  rows[0].text = "bulk modulus";
  return rows;
}

std::vector<LawParameter> shear_fluid() {
  std::vector<LawParameter> rows = table_rows({&D::lambda, &D::eta, &D::eta_inf, &D::kappa, &D::n});
  rows[0].text = "bulk modulus";
  rows[1].text = "viscosity at rest";
  rows[1].positive = true;
  return rows;
}

std::vector<LawParameter> herschel_bulkley() {
  std::vector<LawParameter> rows = table_rows({&D::mu, &D::lambda, &D::tau_y, &D::eta, &D::n});
  rows[3].unit = "Pa s^n";
  rows[3].text = "consistency of the plastic flow";
  rows[3].positive = true;
  return rows;
}

}  // namespace

const std::vector<LawParameter>& law_parameters(LawId id) {
  // In the order of LawId.
  static const std::array<std::vector<LawParameter>, kAnalyticLaws + 1> all{
      table_rows({&D::mu, &D::lambda}),
      viscous_fluid(),
      table_rows({&D::mu, &D::lambda, &D::tau_y}),
      table_rows({&D::mu, &D::lambda, &D::theta}),
      table_rows({&D::mu, &D::lambda, &D::tau_y, &D::eta}),
      table_rows({&D::mu, &D::lambda}),
      inviscid_fluid(),
      table_rows({&D::mu, &D::lambda, &D::theta}),
      table_rows({&D::lambda, &D::c1, &D::c2}),
      shear_fluid(),
      table_rows({&D::mu, &D::lambda, &D::theta, &D::cohesion}),
      herschel_bulkley(),
      {}};
  return all.at(static_cast<std::size_t>(id));
}

std::ptrdiff_t parameter_count(const LawDescription& law) {
  if (law.id != LawId::learned) return std::ptrdiff_t(law_parameters(law.id).size());
  return law.weights != nullptr ? law.weights->latent_size : std::ptrdiff_t(law.z.size());
}

std::vector<double> parameter_values(const LawDescription& law) {
  if (law.id == LawId::learned) return law.z;
  std::vector<double> values;
  for (const LawParameter& p : law_parameters(law.id)) values.push_back(law.*p.member);
  return values;
}

LawDescription with_parameters(LawDescription law, const double* values) {
  if (law.id == LawId::learned) law.z.assign(values, values + parameter_count(law));
  for (const LawParameter& p : law_parameters(law.id)) law.*p.member = *values++;
  return law;
}

}  // namespace uniphy::kernels
