#include "uniphy/io/dataset.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-dataset";

struct Field {
  const char* name;
  const char* units;
  const char* description;
  std::vector<double> LawSamples::*data;
  double limit;  ///< far beyond every material: what is larger is damage
};

constexpr Field kFields[] = {
    {"F", "1", "trial deformation gradient", &LawSamples::F, 1e6},
    {"F_proj", "1", "projected deformation gradient", &LawSamples::F_proj, 1e6},
    {"C", "1/s", "affine velocity", &LawSamples::C, 1e12},
    {"tau", "Pa", "Kirchhoff stress of (F_proj, C)", &LawSamples::tau, 1e18},
};

}  // namespace

DatasetWriter::DatasetWriter(const std::filesystem::path& file, const std::string& config, int gzip)
    : writer_(file) {
  writer_.attribute("/", "format", kFormat);
  writer_.attribute("/", "version", 1);
  writer_.attribute("/", "config", config);
  for (const Field& field : kFields) {
    writer_.extendible<double>(fmt::format("samples/{}", field.name), {3, 3},
                               {field.units, field.description, gzip});
  }
  writer_.extendible<std::int32_t>("samples/trajectory", {},
                                   {"1", "row of /trajectories of each sample", gzip});
  writer_.extendible<std::int32_t>(
      "samples/source", {}, {"1", "0: state of a simulation, 1: state drawn at random", gzip});
}

void DatasetWriter::append(const TrajectoryRecord& record, const LawSamples& samples) {
  const std::int64_t size = samples.size();
  for (const Field& field : kFields) {
    const std::vector<double>& data = samples.*field.data;
    if (static_cast<std::int64_t>(data.size()) != size * 9 || data.size() % 9 != 0) {
      throw Error(fmt::format("{}: /samples/{}: expected {} numbers, found {}",
                              writer_.file().string(), field.name, size * 9, data.size()));
    }
  }
  std::vector<std::int32_t> source = samples.source;
  if (source.empty()) source.assign(static_cast<std::size_t>(size), kSimulatedSample);
  if (static_cast<std::int64_t>(source.size()) != size) {
    throw Error(fmt::format("{}: /samples/source: expected {} numbers, found {}",
                            writer_.file().string(), size, source.size()));
  }
  for (const Field& field : kFields) {
    writer_.append(fmt::format("samples/{}", field.name), (samples.*field.data).data(), size);
  }
  const std::vector<std::int32_t> row(static_cast<std::size_t>(size),
                                      static_cast<std::int32_t>(records_.size()));
  writer_.append("samples/trajectory", row.data(), size);
  writer_.append("samples/source", source.data(), size);
  records_.push_back(record);
  samples_ += size;
}

void DatasetWriter::finish() {
  const auto count = static_cast<std::int64_t>(records_.size());
  std::vector<std::string> material, shape;
  std::vector<double> parameters, dt, density;
  std::vector<std::int64_t> seed, attempt;
  for (const TrajectoryRecord& record : records_) {
    material.push_back(record.material);
    shape.push_back(record.shape);
    parameters.insert(parameters.end(), record.parameters.begin(), record.parameters.end());
    dt.push_back(record.dt);
    density.push_back(record.density);
    seed.push_back(record.seed);
    attempt.push_back(record.attempt);
  }
  writer_.write_strings("trajectories/material", material, {"1", "name of the law"});
  writer_.write("trajectories/parameters", parameters, {count, kernels::kFamilyParameters},
                material_parameter_info());
  writer_.write("trajectories/dt", dt, {count}, {"s", "time step"});
  writer_.write("trajectories/density", density, {count}, {"kg/m^3", "density"});
  writer_.write("trajectories/seed", seed, {count}, {"1", "seed that drew the trajectory"});
  writer_.write("trajectories/attempt", attempt, {count},
                {"1", "which draw of the trajectory it is, counted from 0"});
  writer_.write_strings("trajectories/shape", shape, {"1", "name of the shape"});
  writer_.commit();
}

std::array<double, 2> time_steps(const Dataset& data) {
  if (data.trajectories.empty()) return {};
  const auto [shortest, longest] = std::minmax_element(
      data.trajectories.begin(), data.trajectories.end(),
      [](const TrajectoryRecord& a, const TrajectoryRecord& b) { return a.dt < b.dt; });
  return {shortest->dt, longest->dt};
}

Dataset read_dataset(const std::filesystem::path& file) {
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
  Dataset dataset;
  dataset.config = reader.attribute_text("/", "config");
  const auto material = reader.read_strings("trajectories/material");
  const auto count = static_cast<std::int64_t>(material.size());
  if (count == 0) {
    reader.fail("/trajectories/material", "expected at least one trajectory, found none");
  }
  const auto parameters =
      reader.read<double>("trajectories/parameters", {count, kernels::kFamilyParameters});
  const auto dt = reader.read<double>("trajectories/dt", {count}, hdf5::Values::finite);
  const auto density = reader.read<double>("trajectories/density", {count}, hdf5::Values::finite);
  const auto seed = reader.read<std::int64_t>("trajectories/seed", {count});
  const auto attempt = reader.has("trajectories/attempt")
                           ? reader.read<std::int64_t>("trajectories/attempt", {count})
                           : std::vector<std::int64_t>(static_cast<std::size_t>(count), 0);
  const auto shape = reader.read_strings("trajectories/shape", count);
  for (std::size_t i = 0; i < material.size(); ++i) {
    TrajectoryRecord record;
    record.material = material[i];
    for (std::size_t k = 0; k < record.parameters.size(); ++k) {
      record.parameters[k] = parameters[i * record.parameters.size() + k];
    }
    record.dt = dt[i];
    record.density = density[i];
    record.seed = seed[i];
    record.attempt = attempt[i];
    record.shape = shape[i];
    if (!(record.dt > 0)) {
      reader.fail("/trajectories/dt", fmt::format("expected time steps > 0 s, found {}", dt[i]));
    }
    dataset.trajectories.push_back(std::move(record));
  }

  dataset.trajectory = reader.read<std::int32_t>("samples/trajectory", {-1});
  const auto samples = static_cast<std::int64_t>(dataset.trajectory.size());
  for (const Field& field : kFields) {
    dataset.samples.*field.data = reader.read<double>(fmt::format("samples/{}", field.name),
                                                      {samples, 3, 3}, hdf5::Values::finite);
    hdf5::check_magnitude(reader, fmt::format("/samples/{}", field.name),
                          dataset.samples.*field.data, field.limit);
  }
  if (reader.has("samples/source")) {
    dataset.samples.source = reader.read<std::int32_t>("samples/source", {samples});
    for (const std::int32_t source : dataset.samples.source) {
      if (source == kSimulatedSample || source == kDrawnSample) continue;
      reader.fail("/samples/source", fmt::format("expected 0 or 1, found {}", source));
    }
  }
  dataset.first.assign(static_cast<std::size_t>(count) + 1, 0);
  std::int32_t before = 0;
  for (const std::int32_t row : dataset.trajectory) {
    if (row < before || row >= count) {
      reader.fail("/samples/trajectory",
                  fmt::format("expected rows from 0 to {} in order, found {} after {}", count - 1,
                              row, before));
    }
    before = row;
    ++dataset.first[static_cast<std::size_t>(row) + 1];
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    if (dataset.first[i + 1] == 0) {
      reader.fail(
          "/samples/trajectory",
          fmt::format("expected samples of all {} trajectories, found none of trajectory {}", count,
                      i));
    }
    dataset.first[i + 1] += dataset.first[i];
  }
  return dataset;
}

}  // namespace uniphy
