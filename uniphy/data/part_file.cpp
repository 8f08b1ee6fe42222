#include "uniphy/data/part_file.hpp"

#include <fmt/format.h>

#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/seal.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-dataset-part";

}  // namespace

std::filesystem::path part_path(const std::filesystem::path& directory, std::int64_t trajectory) {
  return directory / fmt::format("{:06}.h5", trajectory);
}

void write_part(const std::filesystem::path& file, const TrajectoryPart& part) {
  const LawSamples& s = part.samples;
  const hdf5::Shape shape{s.size(), 3, 3};
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 1);
  writer.attribute("/", "attempt", part.attempt);
  writer.write("F", s.F, shape, {"1", "trial deformation gradient"});
  writer.write("F_proj", s.F_proj, shape, {"1", "projected deformation gradient"});
  writer.write("C", s.C, shape, {"1/s", "affine velocity"});
  writer.write("tau", s.tau, shape, {"Pa", "Kirchhoff stress"});
  writer.write("source", s.source, {s.size()}, {"1", "0: simulated, 1: drawn"});
  writer.write_strings("failures", part.failures, {"1", "runs that were left out"});
  writer.commit_sealed();
}

std::optional<TrajectoryPart> read_part(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) return std::nullopt;
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
  check_seal(file);
  TrajectoryPart part;
  part.attempt = reader.attribute_integer("/", "attempt");
  part.samples.source = reader.read<std::int32_t>("source", {-1});
  const hdf5::Shape shape{static_cast<std::int64_t>(part.samples.source.size()), 3, 3};
  part.samples.F = reader.read<double>("F", shape, hdf5::Values::finite);
  part.samples.F_proj = reader.read<double>("F_proj", shape, hdf5::Values::finite);
  part.samples.C = reader.read<double>("C", shape, hdf5::Values::finite);
  part.samples.tau = reader.read<double>("tau", shape, hdf5::Values::finite);
  part.failures = reader.read_strings("failures");
  return part;
}

}  // namespace uniphy
