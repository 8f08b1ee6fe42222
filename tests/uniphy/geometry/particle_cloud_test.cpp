#include "uniphy/geometry/particle_cloud.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

class ParticleFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              (std::string("uniphy_particles_") +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::vector<double>& x, const hdf5::Shape& shape,
                              const std::vector<double>& volume = {}) {
    const std::filesystem::path file = folder_ / "particles.h5";
    hdf5::Writer writer(file);
    writer.write("/x", x, shape, {"m", "positions"});
    if (!volume.empty()) {
      writer.write("/volume", volume, {static_cast<std::int64_t>(volume.size())},
                   {"m^3", "volumes"});
    }
    writer.commit();
    return file;
  }
  static std::string error_of(const std::filesystem::path& file, std::int64_t frame = 0) {
    try {
      read_particles(file, frame);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

TEST_F(ParticleFile, ReadsPositionsAndVolumesFromHdf5) {
  const ParticleCloud cloud = read_particles(write({1, 2, 3, 4, 5, 6}, {2, 3}, {0.1, 0.2}));
  ASSERT_EQ(cloud.x.size(), 2u);
  EXPECT_EQ(cloud.x[1], Vector3d(4, 5, 6));
  EXPECT_EQ(cloud.volume, (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(cloud.bounds().sides(), Vector3d(3, 3, 3));
}

TEST_F(ParticleFile, ReadsAFrameOfATrajectory) {
  const auto file = write({1, 2, 3, 4, 5, 6}, {2, 1, 3});
  EXPECT_EQ(read_particles(file, 1).x[0], Vector3d(4, 5, 6));
  EXPECT_THAT(error_of(file, 2), HasSubstr("frame 2: expected 0 to 1"));
}

TEST_F(ParticleFile, RefusesHdf5ThatHoldsNoParticles) {
  EXPECT_THAT(error_of(write({1, 2}, {1, 2})), HasSubstr("/x"));
  EXPECT_THAT(error_of(write({1, 2, std::nan("")}, {1, 3})), HasSubstr("/x"));
  EXPECT_THAT(error_of(write({1, 2, 3}, {1, 3}, {-1})), HasSubstr("positive"));
  EXPECT_THAT(error_of(write({1, 2, 3}, {1, 3}, {1, 2})), HasSubstr("/volume"));
  EXPECT_THAT(error_of(folder_ / "missing.h5"), HasSubstr("missing.h5"));
}

TEST_F(ParticleFile, ReadsTextFiles) {
  const auto file = folder_ / "particles.csv";
  std::ofstream(file) << "x,y,z\n0.1, 0.2, 0.3\r\n# a remark\n\n+1e-1;2.5;.5\n";
  const ParticleCloud cloud = read_particles(file);
  ASSERT_EQ(cloud.x.size(), 2u);
  EXPECT_EQ(cloud.x[0], Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(cloud.x[1], Vector3d(0.1, 2.5, 0.5));
  EXPECT_TRUE(cloud.volume.empty());
}

TEST_F(ParticleFile, ReadsTextOfEverySystem) {
  const ParticleCloud expected = parse_particles("1 2 3\n4 5 6\n", "p");
  for (const char* text :
       {"\xef\xbb\xbf"
        "1;2;3\r\n4;5;6\r\n",
        "\xef\xbb\xbfx;y;z\n1;2;3\n4;5;6", "1,2,3\r4,5,6\r", "\tx\ty\tz\n1\t2\t3\n4\t5\t6\n"}) {
    EXPECT_EQ(parse_particles(text, "p").x, expected.x) << text;
  }
}

TEST(ParticleCloud, SaysWhereVolumesAndPositionsHaveTwoUnits) {
  ParticleCloud cloud;
  for (int k = 0; k < 1000; ++k) {
    cloud.x.emplace_back(0.01 * (k % 10), 0.01 * (k / 10 % 10), 0.01 * (k / 100));
  }
  EXPECT_EQ(odd_scale(cloud, {1e-6}), "");
  EXPECT_EQ(odd_scale(cloud, std::vector<double>(1000, 1e-6)), "");
  EXPECT_EQ(odd_scale(cloud, {1e3}),
            "the particles together have a volume of 1e+06, their bounding box of 0.000729 is 0.09 "
            "long: are both in the same unit?");
  EXPECT_THAT(odd_scale(cloud, {1e-15}), HasSubstr("volume of 1e-12"));
  // A sheet has no bounding box to speak of.
  for (Vector3d& x : cloud.x) x[2] = 0;
  EXPECT_EQ(odd_scale(cloud, {1e-6}), "");
}

struct BadText {
  const char* name;
  const char* text;
  const char* message;
};

class RefusedParticles : public testing::TestWithParam<BadText> {};

TEST_P(RefusedParticles, SaysWhatIsWrong) {
  try {
    parse_particles(GetParam().text, "points.xyz");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("points.xyz"));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Texts, RefusedParticles,
    testing::Values(BadText{"empty", "", "no particles"},
                    BadText{"names_only", "x y z\n", "no particles"},
                    BadText{"two_columns", "1 2 3\n1 2\n", ":2: expected 3 coordinates, found 2"},
                    BadText{"four_columns", "1 2 3 4\n", ":1: expected 3 coordinates, found 4"},
                    BadText{"not_finite", "1 nan 3\n", "expected a finite number, found \"nan\""},
                    BadText{"not_finite_first", "nan nan nan\n", "found \"nan\""},
                    BadText{"not_a_number", "1 2 3\nx y z\n", ":2: expected a finite number"},
                    BadText{"half_a_number", "1 2 3m\n", "found \"3m\""},
                    BadText{"decimal_commas", "0,1;0,2;0,3\n",
                            ":1: expected 3 coordinates, found 6"},
                    BadText{"utf_16",
                            "\xff\xfe"
                            "1",
                            "expected text in ASCII or UTF-8"}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace uniphy
