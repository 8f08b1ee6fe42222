#include "models/torchscript.hpp"

#include <torch/script.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "models/torchscript_names.hpp"
#include "models/torchscript_source.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::models {

namespace {

void add_network(torch::jit::Module& module, const std::string& name,
                 const kernels::MlpWeights& network, torch::Dtype dtype) {
  for (std::size_t k = 0; k < network.layers.size(); ++k) {
    const auto& layer = network.layers[k];
    const std::string suffix = "_" + std::to_string(k);
    module.register_buffer(
        name + "_weight" + suffix,
        torch::tensor(layer.weight, torch::kFloat64).reshape({layer.out, layer.in}).to(dtype));
    module.register_buffer(name + "_bias" + suffix,
                           torch::tensor(layer.bias, torch::kFloat64).to(dtype));
  }
}

c10::List<std::string> names(const std::vector<std::string>& from) {
  c10::List<std::string> list;
  for (const std::string& name : from) list.push_back(name);
  return list;
}

void add_codes(torch::jit::Module& module, const ScriptCodes& codes, int latent_size,
               torch::Dtype dtype) {
  const std::size_t count = codes.materials.size();
  if (codes.z.size() != count * std::size_t(latent_size) || codes.parameters.size() != count)
    throw Error("TorchScript law: codes: expected [" + std::to_string(count) + ", " +
                std::to_string(latent_size) + "] numbers and parameters of " +
                std::to_string(count) + " codes, found " + std::to_string(codes.z.size()) +
                " and " + std::to_string(codes.parameters.size()));
  std::vector<double> parameters;
  for (const auto& row : codes.parameters)
    parameters.insert(parameters.end(), row.begin(), row.end());
  const auto rows = static_cast<std::int64_t>(count);
  module.register_buffer(
      "codes", torch::tensor(codes.z, torch::kFloat64).reshape({rows, latent_size}).to(dtype));
  module.register_buffer(
      "material_parameters",
      torch::tensor(parameters, torch::kFloat64).reshape({rows, kernels::kFamilyParameters}));
  const auto list = c10::ListType::create(c10::StringType::get());
  module.register_attribute("materials", list, names(codes.materials));
  module.register_attribute("parameter_names", list,
                            names({kScriptParameterNames.begin(), kScriptParameterNames.end()}));
  module.register_attribute("parameter_units", list,
                            names({kScriptParameterUnits.begin(), kScriptParameterUnits.end()}));
}

void add_constants(torch::jit::Module& module, bool single_precision) {
  c10::Dict<std::string, double> numbers;
  for (const auto& [name, value] : script_constants(single_precision)) numbers.insert(name, value);
  module.register_attribute(
      "constants", c10::DictType::create(c10::StringType::get(), c10::FloatType::get()), numbers);
}

}  // namespace

torch::jit::Module script_law(const kernels::LearnedLawWeights& weights, torch::Dtype dtype,
                              const ScriptCodes& codes) {
  weights.check();
  if (dtype != torch::kFloat32 && dtype != torch::kFloat64)
    throw Error("TorchScript law: dtype: expected float32 or float64, found " + dtype_name(dtype));
  torch::jit::Module module("__torch__.UniphyLaw");
  const auto text = [&module](const std::string& name, const std::string& value) {
    module.register_attribute(name, c10::StringType::get(), value);
  };
  text("format", kScriptFormat);
  module.register_attribute("version", c10::IntType::get(), kScriptVersion);
  text("form", kernels::form_name(weights.form));
  text("activation", kernels::activation_name(weights.activation));
  module.register_attribute("latent_size", c10::IntType::get(), std::int64_t(weights.latent_size));
  text("dtype", dtype_name(dtype));
  text("units", kScriptUnits);
  add_network(module, "projection", weights.projection, dtype);
  add_network(module, "stress", weights.stress, dtype);
  add_codes(module, codes, weights.latent_size, dtype);
  add_constants(module, dtype == torch::kFloat32);
  module.define(script_source(weights, dtype == torch::kFloat32));
  module.eval();
  return module;
}

std::string script_law_bytes(const kernels::LearnedLawWeights& weights, torch::Dtype dtype,
                             const ScriptCodes& codes) {
  const torch::jit::Module module = script_law(weights, dtype, codes);
  const nlohmann::json metadata = {
      {"format", kScriptFormat},
      {"version", kScriptVersion},
      {"form", kernels::form_name(weights.form)},
      {"activation", kernels::activation_name(weights.activation)},
      {"latent_size", weights.latent_size},
      {"dtype", dtype_name(dtype)},
      {"units", kScriptUnits},
      {"materials", codes.materials},
      {"parameter_names", kScriptParameterNames},
      {"parameter_units", kScriptParameterUnits},
      {"methods",
       {{"code_of", "material (str) -> z [Z] of its first training trajectory"},
        {"project", "F [P, 3, 3], z [Z] or [P, Z], dt (s, of the time step) -> F_proj [P, 3, 3]"},
        {"stress",
         "F_proj [P, 3, 3], C [P, 3, 3] in 1/s, z -> Kirchhoff stress [P, 3, 3] in Pa"}}}};
  std::ostringstream bytes;
  module.save(bytes, {{"metadata.json", metadata.dump(2)}});
  return bytes.str();
}

}  // namespace uniphy::models
