#include "tests/ops/gradient_table/rows.hpp"
#include "tests/support/law_loss_tensors.hpp"
#include "tests/support/learned_law_cases.hpp"
#include "tests/support/mpm_op_cases.hpp"
#include "tests/support/network_cases.hpp"
#include "tests/support/rollout_cases.hpp"

namespace uniphy::testing {

std::vector<GradientRow> learned_law_rows() {
  std::vector<GradientRow> rows;
  for (const auto form : {kernels::LawForm::isotropic, kernels::LawForm::published}) {
    const LearnedLawErrors errors = learned_law_errors(form);
    const std::string op = std::string("learned law, ") + kernels::form_name(form);
    rows.push_back({op, "F", errors.F});
    rows.push_back({op, "C", errors.C});
    rows.push_back({op, "z", errors.z});
    rows.push_back({op, "weights", errors.weights});
  }
  return rows;
}

std::vector<GradientRow> op_rows() {
  std::vector<GradientRow> rows;
  const auto add = [&](const std::string& op, const std::string& input, double error) {
    rows.push_back({op, input, {{"", error}}});
  };
  for (const MpmOpCase& c : mpm_op_cases()) {
    for (std::size_t i = 0; i < c.names.size(); ++i)
      add(c.name, c.names[i], mpm_gradient_error(c, i));
  }
  for (const auto activation :
       {kernels::Activation::gelu, kernels::Activation::silu, kernels::Activation::squareplus}) {
    const NetworkErrors errors = network_errors(activation);
    const std::string op = std::string("network, ") + kernels::activation_name(activation);
    add(op, "x", errors.x);
    add(op, "weights", errors.weights);
    add(op, "biases", errors.biases);
  }
  for (const bool state : {false, true}) {
    const auto errors = isotropic_gradient_errors(law_loss_case(4, 37, state, state));
    const char* const leaves[] = {"z", "caps", "caps at rest", "moduli", "moduli at rest"};
    for (std::size_t k = 0; k < errors.size(); ++k)
      add(state ? "training errors, state" : "training errors", leaves[k], errors[k]);
  }
  for (const RolloutMaterial& m : rollout_materials()) {
    const RolloutErrors errors = rollout_errors(m);
    const bool learned = m.law.id == kernels::LawId::learned;
    const std::string op = "50 steps, " + std::string(learned ? "learned law, " : "") + m.name;
    add(op, "initial velocity", errors.velocity);
    for (std::size_t k = 0; k < errors.parameters.size(); ++k) {
      const std::string name = learned ? "z" : kernels::law_parameters(m.law.id)[k].name;
      // A gradient that is nothing at all must not pass for a right one.
      add(op, name, errors.sizes[k] > 0 ? errors.parameters[k] : INFINITY);
    }
    if (learned) {
      add(op, "weights", rollout_weight_error(m));
      if (m.law.weights->form == kernels::LawForm::isotropic)
        add(op + ", networks of z alone", "weights", rollout_weight_error(of_z_alone(m)));
    }
  }
  return rows;
}

}  // namespace uniphy::testing
