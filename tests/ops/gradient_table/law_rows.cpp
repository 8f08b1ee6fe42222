#include <algorithm>
#include <cmath>
#include <random>

#include "tests/ops/gradient_table/rows.hpp"
#include "tests/support/factor_loss.hpp"
#include "tests/support/law_gradients.hpp"

namespace uniphy::testing {

using kernels::Isa;
using kernels::LawId;

namespace {

bool applies(LawId id, Stage stage) {
  // The projection of a solid that never yields is the identity.
  return stage != Stage::project || is_plastic(id) || is_fluid(id);
}

GradientRow factor_row(Isa isa, std::mt19937_64& random) {
  GradientRow row{"svd3 (U, sigma, Vh)", "F", {}};
  // The factors have a derivative only where the singular values are apart.
  for (const DeformationCase& c : deformation_cases()) {
    const double upper = c.sigma[0] - c.sigma[4], lower = c.sigma[4] - std::abs(c.sigma[8]);
    if (std::min(upper, lower) < 0.01) continue;
    const FactorLoss loss{random_matrix(random), random_matrix(random), random_matrix(random),
                          random_matrix(random)};
    row.errors[c.group] = std::max(row.errors[c.group], loss.error(c.F, isa));
  }
  return row;
}

void add_rows_of(LawId id, Stage stage, Isa isa, std::mt19937_64& random,
                 std::vector<GradientRow>& rows) {
  const std::string op = std::string(kernels::law_name(id)) + " " + stage_name(stage);
  std::string names;
  for (const kernels::LawParameter& p : kernels::law_parameters(id))
    names += (names.empty() ? "" : ", ") + std::string(p.name);
  GradientRow of_F{op, "F", {}}, of_C{op, "C", {}}, of_parameters{op, names, {}},
      of_memory{op, "memory", {}};
  const auto worst = [](double& slot, double value) { slot = std::max(slot, value); };
  const bool has_memory = kernels::law_has_memory(id) && stage != Stage::stress;
  for (const DeformationCase& c : cases_of(sample_law(id))) {
    LawGradientCheck check = make_check(id, stage, isa, random);
    if (has_memory) check.memory = 0.03;
    const auto e =
        check.errors(c.F, random_matrix(random, 3), parameter_array(sample_law(id)), c.step);
    worst(of_F.errors[c.group], e.F);
    if (det(c.F) > 0.1) worst(of_C.errors[c.group], e.C);
    worst(of_parameters.errors[c.group], e.parameters);
    worst(of_memory.errors[c.group], e.memory);
  }
  rows.push_back(of_F);
  if (is_viscous_fluid(id) && stage != Stage::project) rows.push_back(of_C);
  if (stage != Stage::project || is_plastic(id)) rows.push_back(of_parameters);
  if (has_memory) rows.push_back(of_memory);
}

}  // namespace

std::vector<std::string> deformation_columns() {
  std::vector<std::string> all;
  for (const DeformationCase& c : cases_of(sample_law(LawId::plasticine))) {
    if (all.empty() || all.back() != c.group) all.push_back(c.group);
  }
  return all;
}

std::vector<GradientRow> law_rows(Isa isa) {
  std::mt19937_64 random(13);
  std::vector<GradientRow> rows{factor_row(isa, random)};
  for (const LawId id : analytic_laws()) {
    for (const Stage stage : {Stage::project, Stage::stress, Stage::fused}) {
      if (applies(id, stage)) add_rows_of(id, stage, isa, random, rows);
    }
  }
  return rows;
}

}  // namespace uniphy::testing
