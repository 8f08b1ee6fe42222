#include "uniphy/io/latent_file.hpp"

#include <fmt/format.h>

#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/material_parameters.hpp"
#include "uniphy/io/physical_limits.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-latent";

std::vector<double> to_vector(const std::array<double, 3>& a) { return {a.begin(), a.end()}; }

std::array<double, 3> read_vector3(const hdf5::Reader& reader, const std::string& name) {
  const auto v = reader.read<double>(name, {3}, hdf5::Values::finite);
  return {v[0], v[1], v[2]};
}

void write_history(hdf5::Writer& writer, const std::vector<FitRecord>& history) {
  std::vector<std::int32_t> stage, candidate, epoch;
  std::vector<double> horizon, mse;
  for (const FitRecord& record : history) {
    stage.push_back(record.stage);
    candidate.push_back(record.candidate);
    epoch.push_back(record.epoch);
    horizon.push_back(record.horizon);
    mse.push_back(record.mse);
  }
  const hdf5::Shape shape{static_cast<std::int64_t>(history.size())};
  writer.write("history/stage", stage, shape, {"1", "stage of the schedule"});
  writer.write("history/candidate", candidate, shape, {"1", "start that was followed"});
  writer.write("history/epoch", epoch, shape, {"1", "roll-out within the stage"});
  writer.write("history/horizon", horizon, shape, {"s", "end of the frames compared"});
  writer.write("history/mse", mse, shape,
               {"m^2", "mean squared position error, infinite where the roll-out failed"});
}

void read_history(const hdf5::Reader& reader, LatentFile& latent) {
  const auto stage = reader.read<std::int32_t>("history/stage", {-1});
  const hdf5::Shape shape{static_cast<std::int64_t>(stage.size())};
  const auto candidate = reader.read<std::int32_t>("history/candidate", shape);
  const auto epoch = reader.read<std::int32_t>("history/epoch", shape);
  const auto horizon = reader.read<double>("history/horizon", shape, hdf5::Values::finite);
  const auto mse = reader.read<double>("history/mse", shape);
  for (std::size_t i = 0; i < stage.size(); ++i) {
    latent.history.push_back({stage[i], candidate[i], epoch[i], horizon[i], mse[i]});
  }
}

}  // namespace

void write_latent(const std::filesystem::path& file, const LatentFile& latent) {
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 1);
  writer.attribute("/", "law", latent.law);
  writer.attribute("/", "config", latent.config);
  if (latent.dt > 0) writer.attribute("/", "dt", latent.dt);
  writer.attribute("/", "determined", latent.determined ? 1 : 0);
  writer.attribute("/", "rung", latent.rung);
  writer.attribute("/", "explained", latent.explained ? 1 : 0);
  if (latent.law == "learned") {
    writer.attribute("/", "model", latent.model);
    writer.write("z", latent.z, {static_cast<std::int64_t>(latent.z.size())}, {"1", "latent code"});
    std::vector<std::int32_t> code;
    std::vector<double> distance;
    std::vector<std::string> material;
    for (const NearestCode& near : latent.nearest) {
      code.push_back(near.code);
      distance.push_back(near.distance);
      material.push_back(near.material);
    }
    const hdf5::Shape shape{static_cast<std::int64_t>(code.size())};
    writer.write("nearest/code", code, shape, {"1", "row of /latents of the model"});
    writer.write("nearest/distance", distance, shape,
                 {"1", "distance in units of the spread of the codes"});
    writer.write_strings("nearest/material", material, {"1", "law behind that code"});
  } else {
    std::vector<double> values(kernels::kLawParameters, std::numeric_limits<double>::quiet_NaN());
    for (const kernels::LawParameter& p : kernels::law_parameters(latent.analytic.id))
      values[static_cast<std::size_t>(p.place)] = latent.analytic.*p.member;
    writer.write("parameters", values.data(), {kernels::kLawParameters},
                 material_parameter_info(kernels::kLawParameters));
  }
  writer.write("velocity/centre", to_vector(latent.centre), {3}, {"m", "centre of mass"});
  writer.write("velocity/linear", to_vector(latent.linear), {3}, {"m/s", "its velocity"});
  writer.write("velocity/angular", to_vector(latent.angular), {3},
               {"rad/s", "angular velocity about it"});
  write_history(writer, latent.history);
  writer.commit();
}

LatentFile read_latent(const std::filesystem::path& file) {
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
  LatentFile latent;
  latent.law = reader.attribute_text("/", "law");
  latent.config = reader.attribute_text("/", "config");
  if (reader.has_attribute("/", "dt")) {
    latent.dt = reader.attribute_real("/", "dt");
    if (!(latent.dt >= kLeastTimeStep && latent.dt <= 1)) {
      reader.fail("attribute dt of /", fmt::format("expected a time step from {} to 1 s, found {}",
                                                   kLeastTimeStep, latent.dt));
    }
  }
  if (reader.has_attribute("/", "determined")) {
    latent.determined = reader.attribute_integer("/", "determined") != 0;
  }
  if (reader.has_attribute("/", "rung")) latent.rung = reader.attribute_text("/", "rung");
  if (reader.has_attribute("/", "explained")) {
    latent.explained = reader.attribute_integer("/", "explained") != 0;
  }
  if (latent.law == "learned") {
    latent.model = reader.attribute_text("/", "model");
    latent.z = reader.read<double>("z", {-1}, hdf5::Values::finite);
    hdf5::check_magnitude(reader, "/z", latent.z, kLargestCode);
    const auto code = reader.read<std::int32_t>("nearest/code", {-1});
    const auto count = static_cast<std::int64_t>(code.size());
    const auto distance = reader.read<double>("nearest/distance", {count});
    const auto material = reader.read_strings("nearest/material", count);
    for (std::size_t i = 0; i < code.size(); ++i) {
      latent.nearest.push_back({code[i], distance[i], material[i]});
    }
  } else {
    try {
      latent.analytic.id = kernels::law_id(latent.law);
    } catch (const Error& error) {
      reader.fail("attribute law of /", error.what());
    }
    const auto values = reader.read<double>("parameters", {-1});
    for (const kernels::LawParameter& p : kernels::law_parameters(latent.analytic.id)) {
      // Files of the first version hold the parameters of the five families alone.
      if (static_cast<std::size_t>(p.place) >= values.size()) {
        reader.fail("/parameters",
                    fmt::format("expected {} numbers, of which the law {} has {}, "
                                "found {}",
                                kernels::kLawParameters, latent.law, p.name, values.size()));
      }
      const double value = values[p.place];
      if (!(value >= 0)) {
        reader.fail("/parameters", fmt::format("expected {} >= 0, found {}", p.name, value));
      }
      latent.analytic.*p.member = value;
    }
  }
  latent.centre = read_vector3(reader, "velocity/centre");
  latent.linear = read_vector3(reader, "velocity/linear");
  latent.angular = read_vector3(reader, "velocity/angular");
  read_history(reader, latent);
  return latent;
}

}  // namespace uniphy
