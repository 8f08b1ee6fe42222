#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <string>
#include <vector>

#include "ops/kernels/laws/law_parameters.hpp"
#include "ops/kernels/rollout/rollout.hpp"

namespace uniphy::kernels {
namespace {

/// One group of tests/data/reference_trajectories.h5: trajectories from an independent program, in
/// float64. Its attributes give the scene.
class Reference {
 public:
  explicit Reference(const std::string& law) : law_(law) {
    const std::string path =
        std::string(UNIPHY_SOURCE_DIR) + "/tests/data/reference_trajectories.h5";
    file_ = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    if (file_ < 0) throw std::runtime_error("cannot open " + path);
  }
  ~Reference() { H5Fclose(file_); }

  /// 0 where the law has no such parameter.
  double number(const char* name) const {
    double value = 0;
    if (H5Aexists_by_name(file_, law_.c_str(), name, H5P_DEFAULT) <= 0) return 0;
    const hid_t id = H5Aopen_by_name(file_, law_.c_str(), name, H5P_DEFAULT, H5P_DEFAULT);
    H5Aread(id, H5T_NATIVE_DOUBLE, &value);
    H5Aclose(id);
    return value;
  }
  std::vector<double> frames() const {
    const hid_t id = H5Dopen2(file_, (law_ + "/x").c_str(), H5P_DEFAULT);
    if (id < 0) throw std::runtime_error("no x of " + law_);
    const hid_t space = H5Dget_space(id);
    std::vector<double> x(std::size_t(H5Sget_simple_extent_npoints(space)));
    const herr_t status = H5Dread(id, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, x.data());
    H5Sclose(space);
    H5Dclose(id);
    if (status < 0) throw std::runtime_error("cannot read x of " + law_);
    return x;
  }

 private:
  std::string law_;
  hid_t file_;
};

/// The largest distance in one coordinate over all frames.
template <class T>
double largest_difference(const std::string& law) {
  const Reference reference(law);
  const auto number = [&](const char* name) { return reference.number(name); };
  const int side = int(number("res"));
  const double size = number("size"), c[3] = {number("cx"), number("cy"), number("cz")},
               v[3] = {number("vx"), number("vy"), number("vz")},
               w[3] = {number("wx"), number("wy"), number("wz")};
  std::vector<T> x0, v0;
  for (int p = 0; p < side * side * side; ++p) {
    const int index[3] = {p / (side * side), p / side % side, p % side};
    double r[3];
    for (int a = 0; a < 3; ++a) r[a] = ((index[a] + 0.5) / side - 0.5) * size;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      x0.push_back(T(c[a] + r[a]));
      v0.push_back(T(v[a] + w[b] * r[d] - w[d] * r[b]));
    }
  }
  GridSettings grid;
  grid.n = int(number("grid"));
  grid.dt = number("dt");
  const std::ptrdiff_t particles = std::ptrdiff_t(x0.size() / 3);
  const double volume = size * size * size / double(particles);
  LawDescription description;
  description.id = law_id(law);
  for (const LawParameter& p : law_parameters(description.id))
    description.*p.member = number(p.name);
  const Rollout<T> rollout(grid, {{0, particles, make_law<T>(description)}},
                           std::vector<T>(particles, T(number("rho") * volume)),
                           std::vector<T>(particles, T(volume)));

  const std::vector<double> expected = reference.frames();
  const auto steps = std::ptrdiff_t(number("steps")), every = std::ptrdiff_t(number("every"));
  std::vector<T> found(expected.size());
  if (found.size() != std::size_t(3 * particles * Rollout<T>::frame_count(steps, every))) {
    throw std::runtime_error("the reference has another number of frames");
  }
  rollout.record(ParticleState<T>::undeformed(x0, v0), steps, every, found.data(), nullptr,
                 nullptr);
  double worst = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    worst = std::max(worst, std::abs(double(found[k]) - expected[k]));
  }
  return worst;
}

class ReferenceTrajectories : public ::testing::TestWithParam<const char*> {};

TEST_P(ReferenceTrajectories, AreReproduced) {
  const double difference = largest_difference<double>(GetParam());
  RecordProperty("largest_difference", std::to_string(difference));
  std::printf("%s: largest difference %.2g m in float64, %.2g m in float32\n", GetParam(),
              difference, largest_difference<float>(GetParam()));
  EXPECT_LE(difference, 1e-9);
}
INSTANTIATE_TEST_SUITE_P(, ReferenceTrajectories,
                         ::testing::Values("elastic", "newtonian", "plasticine", "sand",
                                           "non_newtonian"),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace uniphy::kernels
