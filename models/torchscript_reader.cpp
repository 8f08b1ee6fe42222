#include <torch/script.h>

#include <array>
#include <fstream>
#include <sstream>
#include <system_error>

#include "models/torchscript.hpp"
#include "models/torchscript_names.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::models {

namespace fs = std::filesystem;
using torch::Tensor;

namespace {

[[noreturn]] void differs(const fs::path& file, const std::string& what,
                          const std::string& expected, const std::string& found) {
  throw Error(file.string() + ": " + what + ": expected " + expected + ", found " + found);
}

std::string quoted(const std::string& s) { return "\"" + s + "\""; }

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
  void expect_texts(const std::string& name, std::int64_t count) const {
    const torch::IValue value = find(name);
    const std::string expected = std::to_string(count) + " strings";
    if (!value.isList()) differs(file_, "attribute " + name, expected, value.tagKind());
    const auto list = value.toListRef();
    if (std::int64_t(list.size()) != count)
      differs(file_, "attribute " + name, expected, std::to_string(list.size()));
    for (const torch::IValue& entry : list)
      if (!entry.isString()) differs(file_, "attribute " + name, expected, entry.tagKind());
  }
  Tensor buffer(const std::string& name, torch::Dtype dtype) const {
    const torch::IValue value = find(name);
    if (!value.isTensor()) differs(file_, "buffer " + name, "a tensor", value.tagKind());
    if (value.toTensor().scalar_type() != dtype)
      differs(file_, "buffer " + name, "dtype " + dtype_name(dtype),
              dtype_name(value.toTensor().scalar_type()));
    return value.toTensor();
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

/// codes [N, latent_size], the names of their N materials, and [N, 5] parameters.
void check_codes(const fs::path& file, const Attributes& attributes, torch::Dtype dtype,
                 std::int64_t latent_size) {
  const auto expect_shape = [&file](const std::string& name, const Tensor& found,
                                    const std::string& rows, std::int64_t columns, bool fits) {
    if (fits && found.size(1) == columns) return;
    std::ostringstream sizes;
    sizes << found.sizes();
    differs(file, "buffer " + name, "[" + rows + ", " + std::to_string(columns) + "]", sizes.str());
  };
  const Tensor codes = attributes.buffer("codes", dtype);
  expect_shape("codes", codes, "N", latent_size, codes.dim() == 2);
  const std::int64_t count = codes.size(0);
  attributes.expect_texts("materials", count);
  const Tensor parameters = attributes.buffer("material_parameters", torch::kFloat64);
  const std::int64_t columns = std::int64_t(kScriptParameterNames.size());
  expect_shape("material_parameters", parameters, std::to_string(count), columns,
               parameters.dim() == 2 && parameters.size(0) == count);
  attributes.expect_texts("parameter_names", columns);
  attributes.expect_texts("parameter_units", columns);
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

ScriptLaw load_script_law(const fs::path& file, std::optional<torch::Dtype> dtype) {
  const torch::jit::Module module = read_archive(file);
  const Attributes attributes(file, module);
  attributes.expect("format", kScriptFormat);
  const std::int64_t version = attributes.integer("version");
  if (version != kScriptVersion)
    differs(file, "attribute version", std::to_string(kScriptVersion),
            std::to_string(version) + "; export the model again");
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
  check_codes(file, attributes, law.dtype, law.latent_size);
  check_method(file, module, "project", 3);
  check_method(file, module, "stress", 3);
  check_method(file, module, "code_of", 1);
  return law;
}

Tensor ScriptLaw::project(const Tensor& F, const Tensor& z, double dt) const {
  return module.run_method("project", F, z, dt).toTensor();
}

Tensor ScriptLaw::stress(const Tensor& F_proj, const Tensor& C, const Tensor& z) const {
  return module.run_method("stress", F_proj, C, z).toTensor();
}

Tensor ScriptLaw::code_of(const std::string& material) const {
  return module.run_method("code_of", material).toTensor();
}

std::vector<std::string> ScriptLaw::materials() const {
  std::vector<std::string> names;
  for (const torch::IValue& name : module.attr("materials").toListRef())
    names.push_back(name.toStringRef());
  return names;
}

}  // namespace uniphy::models
