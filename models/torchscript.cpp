#include "models/torchscript.hpp"

#include <torch/torch.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>
#include <vector>

#include "models/torchscript_source.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::models {

namespace fs = std::filesystem;
using torch::Tensor;

namespace {

std::string dtype_name(torch::Dtype dtype) {
  if (dtype == torch::kFloat32) return "float32";
  if (dtype == torch::kFloat64) return "float64";
  return c10::toString(dtype);
}

[[noreturn]] void differs(const fs::path& file, const std::string& what,
                          const std::string& expected, const std::string& found) {
  throw Error(file.string() + ": " + what + ": expected " + expected + ", found " + found);
}

std::string quoted(const std::string& s) { return "\"" + s + "\""; }

/// The first line of what LibTorch says, without its stack trace.
std::string first_line(const c10::Error& e) {
  const std::string text = e.what_without_backtrace();
  return text.substr(0, text.find('\n'));
}

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

/// Reading attributes of a loaded module, with errors that quote what was found.
class Attributes {
 public:
  Attributes(const fs::path& file, const torch::jit::Module& module)
      : file_(file), module_(module) {}

  std::string text(const std::string& name) const {
    const torch::IValue value = find(name);
    if (!value.isString()) differs(file_, "attribute " + name, "a string", value.tagKind());
    return value.toStringRef();
  }
  std::int64_t integer(const std::string& name) const {
    const torch::IValue value = find(name);
    if (!value.isInt()) differs(file_, "attribute " + name, "an integer", value.tagKind());
    return value.toInt();
  }
  void expect(const std::string& name, const std::string& expected) const {
    const std::string found = text(name);
    if (found != expected) differs(file_, "attribute " + name, quoted(expected), quoted(found));
  }

 private:
  torch::IValue find(const std::string& name) const {
    if (!module_.hasattr(name)) differs(file_, "attribute " + name, "to be there", "none");
    return module_.attr(name);
  }
  const fs::path& file_;
  const torch::jit::Module& module_;
};

/// Buffers of one network: of one dtype, each layer taking what the one before gives.
void check_network(const fs::path& file, const torch::jit::Module& module, const std::string& name,
                   torch::Dtype dtype, std::int64_t in, std::int64_t out) {
  for (int k = 0;; ++k) {
    const std::string weight_name = name + "_weight_" + std::to_string(k);
    const std::string bias_name = name + "_bias_" + std::to_string(k);
    if (!module.hasattr(weight_name)) {
      if (k == 0) differs(file, "buffer " + weight_name, "to be there", "none");
      break;
    }
    const Tensor weight = module.attr(weight_name).toTensor();
    if (!module.hasattr(bias_name)) differs(file, "buffer " + bias_name, "to be there", "none");
    const Tensor bias = module.attr(bias_name).toTensor();
    for (const auto& [label, tensor] : {std::pair(weight_name, weight), std::pair(bias_name, bias)})
      if (tensor.scalar_type() != dtype)
        differs(file, "buffer " + label, "dtype " + dtype_name(dtype),
                dtype_name(tensor.scalar_type()));
    if (weight.dim() != 2 || weight.size(1) != in || bias.dim() != 1 ||
        bias.size(0) != weight.size(0)) {
      std::ostringstream found;
      found << weight.sizes() << " and a bias of " << bias.sizes();
      differs(file, "buffer " + weight_name, "[n, " + std::to_string(in) + "] and a bias of [n]",
              found.str());
    }
    in = weight.size(0);
  }
  if (in != out)
    differs(file, "network " + name, std::to_string(out) + " outputs", std::to_string(in));
}

void check_method(const fs::path& file, const torch::jit::Module& module, const std::string& name,
                  std::size_t arguments) {
  const auto method = module.find_method(name);
  if (!method) differs(file, "method " + name, "to be there", "none");
  const std::size_t found = method->function().getSchema().arguments().size();
  if (found != arguments + 1)  // and self
    differs(file, "method " + name, std::to_string(arguments) + " arguments",
            std::to_string(found - 1));
}

torch::jit::Module read_archive(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error))
    throw Error(file.string() + ": expected a TorchScript file, found no such file");
  std::array<char, 4> magic{};
  std::ifstream(file, std::ios::binary).read(magic.data(), magic.size());
  if (magic != std::array<char, 4>{'P', 'K', 3, 4})
    throw Error(file.string() +
                ": expected a TorchScript file (a zip archive), found something else of " +
                std::to_string(fs::file_size(file, error)) + " bytes");
  try {
    return torch::jit::load(file.string(), torch::kCPU);
  } catch (const c10::Error& e) {
    throw Error(file.string() + ": expected a whole TorchScript file, found one that LibTorch " +
                "cannot read, truncated or damaged: " + first_line(e));
  } catch (const std::exception& e) {
    const std::string text = e.what();
    throw Error(file.string() + ": expected a whole TorchScript file, found one that LibTorch " +
                "cannot read, truncated or damaged: " + text.substr(0, text.find('\n')));
  }
}

}  // namespace

torch::jit::Module script_law(const kernels::LearnedLawWeights& weights, torch::Dtype dtype) {
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
  module.define(script_source(weights, dtype == torch::kFloat32));
  module.eval();
  return module;
}

void save_script_law(const fs::path& file, const kernels::LearnedLawWeights& weights,
                     torch::Dtype dtype) {
  const torch::jit::Module module = script_law(weights, dtype);
  const nlohmann::json metadata = {
      {"format", kScriptFormat},
      {"version", kScriptVersion},
      {"form", kernels::form_name(weights.form)},
      {"activation", kernels::activation_name(weights.activation)},
      {"latent_size", weights.latent_size},
      {"dtype", dtype_name(dtype)},
      {"units", kScriptUnits},
      {"methods",
       {{"project", "F [P, 3, 3], z [Z] or [P, Z] -> F_proj [P, 3, 3]"},
        {"stress",
         "F_proj [P, 3, 3], C [P, 3, 3] in 1/s, z -> Kirchhoff stress [P, 3, 3] in Pa"}}}};
  // To memory first: LibTorch's own file writer ends the program where the disk is full.
  std::ostringstream bytes;
  module.save(bytes, {{"metadata.json", metadata.dump(2)}});
  const fs::path temporary = file.string() + ".tmp";
  std::error_code error;
  errno = 0;
  std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
  stream << bytes.str();
  stream.close();
  if (!stream) {
    const std::string reason = std::strerror(errno);
    fs::remove(temporary, error);
    throw Error(file.string() + ": cannot write: " + reason);
  }
  fs::rename(temporary, file, error);
  if (error) throw Error(file.string() + ": cannot write: " + error.message());
}

ScriptLaw load_script_law(const fs::path& file, std::optional<torch::Dtype> dtype) {
  const torch::jit::Module module = read_archive(file);
  const Attributes attributes(file, module);
  attributes.expect("format", kScriptFormat);
  const std::int64_t version = attributes.integer("version");
  if (version != kScriptVersion)
    differs(file, "attribute version", std::to_string(kScriptVersion), std::to_string(version));
  attributes.expect("units", kScriptUnits);
  ScriptLaw law;
  law.module = module;
  const std::string stored = attributes.text("dtype");
  if (stored != "float32" && stored != "float64")
    differs(file, "attribute dtype", "\"float32\" or \"float64\"", quoted(stored));
  law.dtype = stored == "float32" ? torch::kFloat32 : torch::kFloat64;
  if (dtype && *dtype != law.dtype)
    differs(file, "attribute dtype", quoted(dtype_name(*dtype)), quoted(stored));
  const std::string form = attributes.text("form");
  if (form != "isotropic" && form != "published")
    differs(file, "attribute form", "\"isotropic\" or \"published\"", quoted(form));
  law.form = kernels::form_from_name(form);
  law.latent_size = attributes.integer("latent_size");
  if (law.latent_size < 0)
    differs(file, "attribute latent_size", "0 or more", std::to_string(law.latent_size));
  const auto shape = kernels::network_shape(law.form);
  check_network(file, module, "projection", law.dtype, shape.projection_in + law.latent_size,
                shape.projection_out);
  check_network(file, module, "stress", law.dtype, shape.stress_in + law.latent_size,
                shape.stress_out);
  check_method(file, module, "project", 2);
  check_method(file, module, "stress", 3);
  return law;
}

Tensor ScriptLaw::project(const Tensor& F, const Tensor& z) const {
  return module.run_method("project", F, z).toTensor();
}

Tensor ScriptLaw::stress(const Tensor& F_proj, const Tensor& C, const Tensor& z) const {
  return module.run_method("stress", F_proj, C, z).toTensor();
}

}  // namespace uniphy::models
