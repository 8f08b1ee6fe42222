#include "uniphy/io/model_file.hpp"

#include <fmt/format.h>

#include <cmath>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/physical_limits.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-model";
constexpr int kVersion = 2;
constexpr int kMaximumLayers = 64;
constexpr std::int64_t kMaximumLatent = 4096;

template <class T>
void write_network(hdf5::Writer& writer, const std::string& name,
                   const kernels::MlpWeights& network) {
  for (std::size_t k = 0; k < network.layers.size(); ++k) {
    const auto& layer = network.layers[k];
    const std::string group = fmt::format("{}/layer_{}", name, k);
    const std::vector<T> weight(layer.weight.begin(), layer.weight.end());
    const std::vector<T> bias(layer.bias.begin(), layer.bias.end());
    writer.write(group + "/weight", weight, {layer.out, layer.in}, {"1", "weight [out, in]"});
    writer.write(group + "/bias", bias, {layer.out}, {"1", "bias [out]"});
  }
}

kernels::MlpWeights read_network(const hdf5::Reader& reader, const std::string& name) {
  kernels::MlpWeights network;
  if (!reader.has(name))
    reader.fail(name, "expected a group of layers, found nothing of that name");
  const std::size_t count = reader.members(name).size();
  if (count == 0 || count > kMaximumLayers) {
    reader.fail(name, fmt::format("expected 1 to {} layers, found {}", kMaximumLayers, count));
  }
  for (std::size_t k = 0; k < count; ++k) {
    const std::string group = fmt::format("{}/layer_{}", name, k);
    kernels::MlpWeights::Layer layer;
    layer.weight = reader.read<double>(group + "/weight", {-1, -1}, hdf5::Values::finite);
    const hdf5::Shape shape = reader.shape(group + "/weight");
    layer.bias = reader.read<double>(group + "/bias", {shape[0]}, hdf5::Values::finite);
    hdf5::check_magnitude(reader, group + "/weight", layer.weight, kLargestWeight);
    hdf5::check_magnitude(reader, group + "/bias", layer.bias, kLargestWeight);
    layer.out = static_cast<int>(shape[0]);
    layer.in = static_cast<int>(shape[1]);
    network.layers.push_back(std::move(layer));
  }
  return network;
}

void expect_text(const hdf5::Reader& reader, const char* name, const std::string& expected) {
  const std::string found = reader.attribute_text("/", name);
  if (found != expected) {
    reader.fail(fmt::format("attribute {}", name),
                fmt::format("expected \"{}\", found \"{}\"", expected, found));
  }
}

/// The same error with the file in front.
template <class Function>
auto naming(const hdf5::Reader& reader, const std::string& object, const Function& function) {
  try {
    return function();
  } catch (const Error& error) {
    reader.fail(object, error.what());
  }
}

}  // namespace

std::vector<double> ModelFile::code(std::int64_t i) const {
  if (i < 0 || i >= codes()) {
    throw Error(fmt::format("latent {}: expected an index from 0 to {}", i, codes() - 1));
  }
  const auto start = latents.begin() + i * weights.latent_size;
  return std::vector<double>(start, start + weights.latent_size);
}

void write_model(const std::filesystem::path& file, const ModelFile& model, bool single_precision) {
  const auto& weights = model.weights;
  weights.check();
  const std::int64_t count = model.codes();
  const std::int64_t size = weights.latent_size;
  if (model.parameters.size() != model.materials.size()) {
    throw Error(fmt::format("{}: /latents/parameters: expected {} rows, found {}", file.string(),
                            count, model.parameters.size()));
  }
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", kVersion);
  writer.attribute("/", "form", kernels::form_name(weights.form));
  writer.attribute("/", "latent_size", weights.latent_size);
  writer.attribute("/", "activation", kernels::activation_name(weights.activation));
  writer.attribute("/", "dtype", single_precision ? "float32" : "float64");
  writer.attribute("/", "stress_units", "Pa");
  writer.attribute("/", "rate_units", "1/s");
  writer.attribute("/", "config", model.config);
  if (model.training_dt[0] > 0) {
    writer.attribute("/", "training_dt",
                     std::vector<double>(model.training_dt.begin(), model.training_dt.end()));
  }
  if (single_precision) {
    write_network<float>(writer, "/projection", weights.projection);
    write_network<float>(writer, "/stress", weights.stress);
  } else {
    write_network<double>(writer, "/projection", weights.projection);
    write_network<double>(writer, "/stress", weights.stress);
  }
  writer.write("latents/z", model.latents, {count, size}, {"1", "latent code of a trajectory"});
  writer.write_strings("latents/material", model.materials, {"1", "law behind each code"});
  std::vector<double> parameters;
  for (const auto& row : model.parameters) {
    parameters.insert(parameters.end(), row.begin(), row.end());
  }
  writer.write("latents/parameters", parameters, {count, kernels::kFamilyParameters},
               material_parameter_info());
  writer.commit();
}

ModelFile read_model(const std::filesystem::path& file) {
  const hdf5::Reader reader(file);
  const std::int64_t version = reader.check_format(kFormat, kVersion);
  if (version < kVersion) {  // whose networks answer with other numbers
    reader.fail("attribute version",
                fmt::format("expected {}, found {}; train the model again", kVersion, version));
  }
  expect_text(reader, "stress_units", "Pa");
  expect_text(reader, "rate_units", "1/s");
  const std::string dtype = reader.attribute_text("/", "dtype");
  if (dtype != "float64" && dtype != "float32") {
    reader.fail("attribute dtype",
                fmt::format("expected \"float64\" or \"float32\", found \"{}\"", dtype));
  }
  ModelFile model;
  auto& weights = model.weights;
  const std::string form = reader.attribute_text("/", "form");
  weights.form = naming(reader, "attribute form", [&] { return kernels::form_from_name(form); });
  const std::string activation = reader.attribute_text("/", "activation");
  weights.activation = naming(reader, "attribute activation",
                              [&] { return kernels::activation_from_name(activation); });
  const std::int64_t size = reader.attribute_integer("/", "latent_size");
  if (size < 0 || size > kMaximumLatent) {
    reader.fail("attribute latent_size",
                fmt::format("expected 0 to {}, found {}", kMaximumLatent, size));
  }
  weights.latent_size = static_cast<int>(size);
  weights.projection = read_network(reader, "/projection");
  weights.stress = read_network(reader, "/stress");
  naming(reader, "weights", [&] {
    weights.check();
    return 0;
  });

  model.config = reader.attribute_text("/", "config");
  if (reader.has_attribute("/", "training_dt")) {
    const std::vector<double> dt = reader.attribute_reals("/", "training_dt", 2);
    if (!(dt[0] > 0 && dt[0] <= dt[1] && std::isfinite(dt[1]))) {
      reader.fail(
          "attribute training_dt",
          fmt::format("expected two time steps > 0 s, the shorter one first, found {} and {}",
                      dt[0], dt[1]));
    }
    model.training_dt = {dt[0], dt[1]};
  }
  model.materials = reader.read_strings("latents/material");
  const std::int64_t count = model.codes();
  model.latents = reader.read<double>("latents/z", {count, size}, hdf5::Values::finite);
  hdf5::check_magnitude(reader, "/latents/z", model.latents, kLargestCode);
  const auto parameters =
      reader.read<double>("latents/parameters", {count, kernels::kFamilyParameters});
  model.parameters.resize(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    MaterialParameters& row = model.parameters[i];
    for (std::size_t k = 0; k < row.size(); ++k) row[k] = parameters[i * row.size() + k];
  }
  return model;
}

}  // namespace uniphy
