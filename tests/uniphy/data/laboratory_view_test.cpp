#include "uniphy/data/laboratory_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

/// 64 particles of a box of side 0.4 that moves along x, 21 frames.
Observation moving_box() {
  Observation o;
  o.dt = 1e-3;
  o.frames = 21;
  o.particles = 64;
  o.volume.assign(64, 1e-3);
  for (std::int64_t f = 0; f < o.frames; ++f) {
    o.time.push_back(0.01 * double(f));
    for (int p = 0; p < 64; ++p) {
      o.x.push_back(0.3 + 0.4 / 3 * (p / 16) + 0.002 * double(f));
      o.x.push_back(0.3 + 0.4 / 3 * (p / 4 % 4));
      o.x.push_back(0.3 + 0.4 / 3 * (p % 4));
    }
  }
  return o;
}

TEST(LaboratoryView, EverythingIsWhatItWas) {
  const Observation whole = moving_box(), seen = laboratory_view(whole, {});
  EXPECT_FALSE(seen.tracked());
  EXPECT_EQ(seen.x, whole.x);
  EXPECT_EQ(seen.time, whole.time);
  EXPECT_EQ(seen.noise, 0);
}

TEST(LaboratoryView, APartOfThePointsIsTrackedBesideTheBody) {
  const Observation whole = moving_box();
  LaboratoryView view;
  view.share = 0.25;
  view.stride = 5;
  const Observation seen = laboratory_view(whole, view);
  ASSERT_TRUE(seen.tracked());
  EXPECT_EQ(seen.points(), 16);
  EXPECT_EQ(seen.frames, 5);
  EXPECT_EQ(seen.body, whole.start());
  EXPECT_THAT(seen.time, ::testing::ElementsAre(0, 0.05, 0.1, 0.15, 0.2));
  for (std::int64_t p = 0; p < 16; ++p)
    EXPECT_NEAR(seen.positions(4)[3 * p] - seen.positions(0)[3 * p], 0.04, 1e-12);
  EXPECT_EQ(std::vector<double>(seen.x.begin(), seen.x.begin() + 48), seen.tracers);
  view.seed = 2;
  EXPECT_NE(laboratory_view(whole, view).tracers, seen.tracers);
  view.seed = 1;
  EXPECT_EQ(laboratory_view(whole, view).tracers, seen.tracers);
}

TEST(LaboratoryView, MayBeginLater) {
  const Observation whole = moving_box();
  LaboratoryView view;
  view.first = 4;
  view.stride = 8;
  const Observation seen = laboratory_view(whole, view);
  EXPECT_EQ(seen.time, (std::vector<double>{whole.time[4], whole.time[12], whole.time[20]}));
  EXPECT_EQ(std::vector<double>(whole.positions(4), whole.positions(5)), seen.start());
  view.share = 0.5;  // the body beside the points is that of the frame, too
  EXPECT_EQ(laboratory_view(whole, view).body, seen.start());
  view.first = 13;
  EXPECT_THAT(testing::error_of([&] { laboratory_view(whole, view); }),
              HasSubstr("expected at least two of 0 to 20, found every 8th from 13 to 20"));
}

TEST(LaboratoryView, ABodyThatIsNotSeenLaterCannotBeginThere) {
  Observation whole = moving_box();
  whole.x[3 * 64 * 2 + 5] = std::numeric_limits<double>::quiet_NaN();
  LaboratoryView view;
  view.first = 2;
  EXPECT_THAT(testing::error_of([&] { laboratory_view(whole, view); }),
              HasSubstr("frames.first: expected all particles of the body in frame 2"));
}

TEST(LaboratoryView, NoiseAndHiddenPointsAreAsManyAsAskedFor) {
  const Observation whole = moving_box();
  LaboratoryView view;
  view.noise = 0.01;
  view.hidden = 0.25;
  const Observation seen = laboratory_view(whole, view);
  EXPECT_NEAR(seen.noise, 0.004, 1e-12);
  double square = 0, count = 0;
  for (std::int64_t f = 0; f < seen.frames; ++f) {
    for (std::int64_t p = 0; p < 64; ++p) {
      if (!seen.is_seen(f, p)) continue;
      for (int k = 0; k < 3; ++k)
        square += std::pow(seen.positions(f)[3 * p + k] - whole.positions(f)[3 * p + k], 2);
      count += 3;
    }
  }
  EXPECT_NEAR(count / double(whole.x.size()), 0.75, 0.04);
  EXPECT_NEAR(std::sqrt(square / count), 0.004, 2e-4);
  view.says_noise = false;
  EXPECT_TRUE(std::isnan(laboratory_view(whole, view).noise));
}

/// Numbers of the particles of moving_box that stand at the points of a frame; −1: none.
std::vector<std::int64_t> particles_of(const Observation& cloud, std::int64_t frame,
                                       const Observation& whole, std::int64_t whole_frame) {
  std::vector<std::int64_t> found;
  for (std::int64_t p = 0; p < cloud.points(); ++p) {
    const double* x = cloud.positions(frame) + 3 * p;
    std::int64_t q = whole.particles - 1;
    while (q >= 0 && !std::equal(x, x + 3, whole.positions(whole_frame) + 3 * q)) --q;
    found.push_back(q);
  }
  return found;
}

TEST(LaboratoryView, ACloudShowsOtherParticlesInEveryFrame) {
  const Observation whole = moving_box();
  LaboratoryView view;
  view.cloud = 40;
  view.stride = 10;
  const Observation seen = laboratory_view(whole, view);
  EXPECT_EQ(seen.cloud, 40);
  EXPECT_EQ(seen.points(), 40);
  EXPECT_EQ(seen.frames, 3);
  EXPECT_FALSE(seen.tracked());
  EXPECT_EQ(seen.body, whole.start());
  EXPECT_EQ(seen.volume, whole.volume);
  const std::vector<std::int64_t> first = particles_of(seen, 0, whole, 0);
  const std::vector<std::int64_t> last = particles_of(seen, 2, whole, 20);
  for (std::vector<std::int64_t> drawn : {first, last}) {
    EXPECT_FALSE(std::is_sorted(drawn.begin(), drawn.end()));
    std::sort(drawn.begin(), drawn.end());
    EXPECT_GE(drawn.front(), 0);
    EXPECT_EQ(std::unique(drawn.begin(), drawn.end()), drawn.end()) << "drawn twice";
  }
  EXPECT_NE(first, last);
  EXPECT_EQ(laboratory_view(whole, view).x, seen.x);
  view.seed = 2;
  EXPECT_NE(laboratory_view(whole, view).x, seen.x);
}

TEST(LaboratoryView, ACloudIsWrittenAndReadBack) {
  const testing::Scratch scratch;
  LaboratoryView view;
  view.cloud = 64;
  view.noise = 0.01;
  const Observation seen = laboratory_view(moving_box(), view);
  EXPECT_NEAR(seen.noise, 0.004, 1e-12);
  write_observation(scratch.file("o.h5"), seen);
  const Observation read = read_observation(scratch.file("o.h5"));
  EXPECT_EQ(read.x, seen.x);
  EXPECT_EQ(read.cloud, 64);
  EXPECT_EQ(read.noise, seen.noise);
  EXPECT_THAT(testing::error_of([&] { laboratory_view(read, {}); }),
              HasSubstr("attribute correspondence of /x: expected \"points\", found \"none\""));
}

TEST(LaboratoryView, ACloudThatCannotBeDrawnIsAnError) {
  const auto message = [](const auto& change) {
    LaboratoryView view;
    view.cloud = 10;
    change(view);
    return testing::error_of([&] { laboratory_view(moving_box(), view); });
  };
  EXPECT_THAT(message([](LaboratoryView& v) { v.cloud = 65; }),
              HasSubstr("cloud.points: expected at most 64, the points there are, found 65"));
  EXPECT_THAT(message([](LaboratoryView& v) { v.share = 0.5; }),
              HasSubstr("expected points.share 1 and points.hidden 0, which are of tracked points, "
                        "found 0.5 and 0"));
  EXPECT_THAT(message([](LaboratoryView& v) { v.hidden = 0.1; }), HasSubstr("found 1 and 0.1"));
}

TEST(LaboratoryView, NothingToSeeIsAnError) {
  LaboratoryView view;
  view.share = 0.001;
  EXPECT_THAT(testing::error_of([&] { laboratory_view(moving_box(), view); }),
              HasSubstr("points.share: expected at least one of 64 points"));
  view = {};
  view.stride = 30;
  EXPECT_THAT(testing::error_of([&] { laboratory_view(moving_box(), view); }),
              HasSubstr("frames: expected at least two of 0 to 20"));
}

}  // namespace
}  // namespace uniphy
