#include "models/torchscript_source.hpp"

#include <cstdio>
#include <limits>
#include <sstream>

#include "models/script_text.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/power_law.hpp"
#include "ops/kernels/learned/published_scales.hpp"
#include "ops/kernels/spectral/limits.hpp"

namespace uniphy::models {

using kernels::Activation;
using kernels::LawForm;

namespace {

std::string literal(double x) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17e", x);
  return text;
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size())
    text.replace(at, what.size(), with);
  return text;
}

/// The methods of the class that a file ends with, moved to the left margin: from its first
/// indented def on.
std::string methods(const std::string& file) {
  const std::string indent = "    ";
  const std::size_t first = file.find("\n" + indent + "def ");
  if (first == std::string::npos)
    throw Error("models/script: expected a class with methods, found none");
  std::istringstream lines(file.substr(first + 1));
  std::string text, line;
  while (std::getline(lines, line))
    text +=
        (line.compare(0, indent.size(), indent) == 0 ? line.substr(indent.size()) : line) + "\n";
  return text + "\n";
}

/// def NAME_network(self, x): the layers one after the other. By addmm: the backward of linear is
/// fused with that of the activation by LibTorch 2.6, which then compiles for minutes.
std::string network(const std::string& name, std::size_t depth, Activation activation) {
  std::string text = "def " + name + "_network(self, x: Tensor) -> Tensor:\n";
  for (std::size_t k = 0; k < depth; ++k) {
    const std::string n = std::to_string(k);
    text += "    x = torch.addmm(self." + name + "_bias_" + n + ", x, self." + name + "_weight_" +
            n + ".t())\n";
    if (k + 1 == depth) break;
    if (activation == Activation::gelu)
      text += "    x = torch.gelu(x)\n";
    else if (activation == Activation::silu)
      text += "    x = torch.silu(x)\n";
    else
      text += "    x = 0.5 * (x + torch.sqrt(x * x + 4.0)) - 1.0\n";
  }
  return text + "    return x\n\n";
}

}  // namespace

std::map<std::string, double> script_constants(bool single_precision) {
  const double epsilon = single_precision ? double(std::numeric_limits<float>::epsilon())
                                          : std::numeric_limits<double>::epsilon();
  const double tiny = single_precision ? double(std::numeric_limits<float>::min())
                                       : std::numeric_limits<double>::min();
  return {{"STRESS_SCALE", kernels::kStressScale},
          {"STRESS_RATE", kernels::kStressRate},
          {"STRAIN_SCALE", kernels::kStrainScale},
          {"STRAIN_RATE", kernels::kStrainRate},
          {"DELTA_OVER_STRAIN", kernels::kDeltaOverStrain},
          {"TIME_SCALE", kernels::kTimeScale},
          {"SMOOTHING", kernels::kInvariantSmoothing},
          {"SINH_LIMIT", kernels::kSinhLimit},
          {"LEAST_VISCOSITY", kernels::kLeastViscosity},
          {"EXPONENT_LIMIT", kernels::kExponentLimit},
          {"FLOW_STEP", kernels::kFlowStep},
          {"FLOW_EXCESS", kernels::kFlowExcess},
          {"FLOW_POWER_LIMIT", kernels::kFlowPowerLimit},
          {"RATE_SCALE_LIMIT", kernels::kRateScaleLimit},
          {"RATE_EXPONENT_LIMIT", kernels::kRateExponentLimit},
          {"ARGUMENT_LIMIT", kernels::kArgumentLimit},
          {"FLUID_CAP", kernels::kFluidCap},
          {"MINIMUM_STRETCH", kernels::kMinimumStretch},
          {"LEAST_SUM", kernels::kLeastSum},
          {"FACTOR_FLOOR", single_precision ? 1e-3 : 1e-6},  // svd3_adjoint's
          {"EPSILON", epsilon},
          {"TINY", tiny}};
}

static_assert(kernels::kFlowStep == 2e-4, "the default of project's dt in models/script");

std::string script_source(const kernels::LearnedLawWeights& weights, bool single_precision) {
  std::string text = methods(kLawScript);
  text += network("projection", weights.projection.layers.size(), weights.activation);
  text += network("stress", weights.stress.layers.size(), weights.activation);
  text += methods(weights.form == LawForm::isotropic ? kIsotropicScript : kPublishedScript);
  for (const auto& [name, value] : script_constants(single_precision))
    text = replaced(text, "self." + name, literal(value));
  text = replaced(text, "self.latent_size", std::to_string(weights.latent_size));
  // In the language of TorchScript torch.linalg.f is named for its operator, aten::linalg_f.
  return replaced(text, "torch.linalg.", "torch.linalg_");
}

}  // namespace uniphy::models
