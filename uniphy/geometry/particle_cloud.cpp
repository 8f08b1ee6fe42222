#include "uniphy/geometry/particle_cloud.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/text_lines.hpp"
#include "uniphy/io/trajectory.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kMaximumBytes = std::size_t{1} << 30;

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
  cloud.of_trajectory = is_trajectory(reader);
  cloud.failure = trajectory_failure(reader);
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
  TextLines lines(text, name);
  while (lines.next()) {
    const std::vector<std::string_view> words = lines.words(" \t,;");
    if (words.empty() || words[0][0] == '#') continue;
    if (words.size() != 3) {
      lines.fail("expected 3 coordinates, found " + std::to_string(words.size()) + " columns");
    }
    double unused;
    const bool is_text = std::none_of(words.begin(), words.end(), [&](std::string_view word) {
      return parse_number(word, &unused) || word == "nan" || word == "inf";
    });
    if (first && is_text && words[0].find_first_of("0123456789") == words[0].npos) {
      first = false;
      continue;  // the names of the columns
    }
    first = false;
    Vector3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = lines.number(words[axis], "");
    cloud.x.push_back(p);
  }
  if (cloud.x.empty()) throw Error(name + ": no particles: expected lines \"x y z\"");
  return cloud;
}

std::string odd_scale(const ParticleCloud& cloud, const std::vector<double>& volume) {
  const Bounds bounds = cloud.bounds();
  const double longest = bounds.largest_side();
  double sum = std::accumulate(volume.begin(), volume.end(), 0.0);
  if (volume.size() == 1) sum *= static_cast<double>(cloud.x.size());
  const double box = bounds.sides().prod(), cube = longest * longest * longest;
  if (cloud.x.size() < 2 || (sum <= 10 * cube && sum >= 1e-4 * box)) return "";
  return fmt::format(
      "the particles together have a volume of {:.3g}, their bounding box of {:.3g} "
      "is {:.3g} long: are both in the same unit?",
      sum, box, longest);
}

ParticleCloud read_particles(const std::filesystem::path& file, std::int64_t frame) {
  const std::string extension = file.extension().string();
  if (extension == ".h5" || extension == ".hdf5") return read_particles_hdf5(file, frame);
  return parse_particles(read_text_file(file, kMaximumBytes), file.string());
}

}  // namespace uniphy
