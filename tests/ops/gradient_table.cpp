// Prints the gradient table: op × case → relative error of the hand-written adjoint against central
// differences in float64, as Markdown. Usage: uniphy_gradient_table [baseline|avx2|avx512]

#include <cstdio>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "ops/kernels/error.hpp"
#include "tests/support/factor_loss.hpp"
#include "tests/support/law_gradients.hpp"

namespace uniphy::testing {
namespace {

using kernels::Isa;
using kernels::LawId;

/// The columns, in the order of deformation_cases.
std::vector<std::string> groups() {
  std::vector<std::string> all;
  for (const DeformationCase& c : cases_of(sample_law(LawId::plasticine))) {
    if (all.empty() || all.back() != c.group) all.push_back(c.group);
  }
  return all;
}

bool applies(LawId id, Stage stage) {
  // The projection of a solid that never yields is the identity.
  return stage != Stage::project || is_plastic(id) || is_fluid(id);
}

void print_row(const std::string& op, const char* input,
               const std::map<std::string, double>& worst) {
  std::printf("| %s | %s |", op.c_str(), input);
  for (const std::string& group : groups()) {
    const auto at = worst.find(group);
    if (at == worst.end())
      std::printf(" |");
    else
      std::printf(" %.0e |", at->second);
  }
  std::printf("\n");
}

void print_table(Isa isa) {
  std::printf("| op | with respect to |");
  for (const std::string& group : groups()) std::printf(" %s |", group.c_str());
  std::printf("\n|---|---|");
  for (std::size_t i = 0; i < groups().size(); ++i) std::printf("---|");
  std::printf("\n");
  std::mt19937_64 random(13);
  // The factors have a derivative only where the singular values are apart.
  std::map<std::string, double> of_factors;
  for (const DeformationCase& c : deformation_cases()) {
    const double upper = c.sigma[0] - c.sigma[4], lower = c.sigma[4] - std::abs(c.sigma[8]);
    if (std::min(upper, lower) < 0.01) continue;
    const FactorLoss loss{random_matrix(random), random_matrix(random), random_matrix(random),
                          random_matrix(random)};
    of_factors[c.group] = std::max(of_factors[c.group], loss.error(c.F, isa));
  }
  print_row("svd3 (U, sigma, Vh)", "F", of_factors);
  for (const LawId id : analytic_laws()) {
    for (const Stage stage : {Stage::project, Stage::stress, Stage::fused}) {
      if (!applies(id, stage)) continue;
      const std::string op = std::string(kernels::law_name(id)) + " " + stage_name(stage);
      std::map<std::string, double> of_F, of_C, of_parameters;
      const auto worst = [](double& slot, double value) { slot = std::max(slot, value); };
      for (const DeformationCase& c : cases_of(sample_law(id))) {
        const LawGradientCheck check = make_check(id, stage, isa, random);
        const auto e =
            check.errors(c.F, random_matrix(random, 3), parameter_array(sample_law(id)), c.step);
        worst(of_F[c.group], e.F);
        if (det(c.F) > 0.1) worst(of_C[c.group], e.C);
        worst(of_parameters[c.group], e.parameters);
      }
      print_row(op, "F", of_F);
      if (id == LawId::newtonian && stage != Stage::project) print_row(op, "C", of_C);
      if (stage != Stage::project || is_plastic(id)) {
        std::string names;
        for (const std::string& name : kernels::parameter_names(id))
          names += (names.empty() ? "" : ", ") + name;
        print_row(op, names.c_str(), of_parameters);
      }
    }
  }
}

}  // namespace
}  // namespace uniphy::testing

int main(int argc, char** argv) {
  using namespace uniphy;
  try {
    kernels::Isa isa = kernels::active_isa();
    if (argc > 1) {
      bool known = false;
      for (const kernels::Isa candidate : kernels::available_isas()) {
        if (std::strcmp(argv[1], kernels::isa_name(candidate)) == 0) isa = candidate, known = true;
      }
      if (!known) throw Error(std::string("instruction set not available here: ") + argv[1]);
    }
    testing::print_table(isa);
  } catch (const Error& error) {
    std::fprintf(stderr, "uniphy_gradient_table: %s\n", error.what());
    return 1;
  }
}
