#include "uniphy/geometry/particle_cloud.hpp"

#include "ops/kernels/base/error.hpp"
#include "uniphy/geometry/text_file.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

ParticleCloud read_particles_hdf5(const std::filesystem::path& file, std::int64_t frame) {
  const hdf5::Reader reader(file);
  const hdf5::Shape shape = reader.shape("/x");
  std::vector<double> numbers;
  if (shape.size() == 3) {
    if (frame < 0 || frame >= shape[0]) {
      reader.fail("/x", "frame " + std::to_string(frame) + ": expected 0 to " +
                            std::to_string(shape[0] - 1) + ", the frames of the file");
    }
    numbers = reader.read_rows<double>("/x", {-1, -1, 3}, frame, 1, hdf5::Values::finite);
  } else {
    numbers = reader.read<double>("/x", {-1, 3}, hdf5::Values::finite);
  }
  if (numbers.empty()) reader.fail("/x", "expected particles, found none");
  ParticleCloud cloud;
  const std::size_t count = numbers.size() / 3;
  cloud.x.reserve(count);
  for (std::size_t p = 0; p < count; ++p) {
    cloud.x.emplace_back(numbers[3 * p], numbers[3 * p + 1], numbers[3 * p + 2]);
  }
  if (reader.has("/volume")) {
    cloud.volume =
        reader.read<double>("/volume", {static_cast<std::int64_t>(count)}, hdf5::Values::finite);
    for (const double volume : cloud.volume) {
      if (!(volume > 0)) reader.fail("/volume", "expected positive numbers");
    }
  }
  return cloud;
}

}  // namespace

Bounds bounds_of(const std::vector<Vector3d>& points) {
  Bounds bounds{points[0], points[0]};
  for (const Vector3d& p : points) {
    bounds.min = bounds.min.cwiseMin(p);
    bounds.max = bounds.max.cwiseMax(p);
  }
  return bounds;
}

ParticleCloud parse_particles(const std::string& text, const std::string& name) {
  ParticleCloud cloud;
  bool first = true;
  for_each_line(text, [&](std::int64_t number, std::string_view line) {
    const std::vector<std::string_view> words = split_words(line, " \t,;");
    if (words.empty() || words[0][0] == '#') return;
    const auto fail = [&](const std::string& message) {
      throw Error(name + ":" + std::to_string(number) + ": " + message);
    };
    if (words.size() != 3) {
      fail("expected 3 coordinates, found " + std::to_string(words.size()) + " columns");
    }
    Vector3d p;
    int read = 0;
    while (read < 3 && parse_number(words[read], &p[read])) ++read;
    const bool column_names = first && words[0].find_first_of("0123456789") == words[0].npos &&
                              words[0] != "nan" && words[0] != "inf";
    first = false;
    if (read < 3) {
      if (column_names && read == 0) return;
      fail("expected a finite number, found \"" + std::string(words[read]) + "\"");
    }
    cloud.x.push_back(p);
  });
  if (cloud.x.empty()) throw Error(name + ": no particles: expected lines \"x y z\"");
  return cloud;
}

ParticleCloud read_particles(const std::filesystem::path& file, std::int64_t frame) {
  const std::string extension = file.extension().string();
  if (extension == ".h5" || extension == ".hdf5") return read_particles_hdf5(file, frame);
  return parse_particles(read_text_file(file), file.string());
}

}  // namespace uniphy
