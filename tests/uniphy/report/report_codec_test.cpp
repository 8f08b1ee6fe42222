#include "uniphy/report/report_codec.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace uniphy {
namespace {

/// Particles that swing and jump.
Motion example_motion(std::int64_t particles, std::int64_t frames) {
  std::mt19937_64 draw(3);
  std::uniform_real_distribution<double> unit(0, 1);
  Motion motion;
  motion.particles = particles;
  motion.body.assign(static_cast<std::size_t>(particles), 0);
  std::vector<double> phase;
  for (std::int64_t p = 0; p < 3 * particles; ++p) phase.push_back(6 * unit(draw));
  for (std::int64_t f = 0; f < frames; ++f) {
    motion.time.push_back(0.01 * double(f));
    for (const double a : phase) {
      const double jump = unit(draw) < 0.02 ? unit(draw) : 0;
      motion.x.push_back(static_cast<float>(-2 + std::sin(a + 0.1 * double(f)) + jump));
    }
  }
  return motion;
}

TEST(ReportCodec, PositionsComeBackToHalfAStepAtEveryLevel) {
  const Motion motion = example_motion(50, 40);
  const Box box = box_of({motion});
  for (const CodecLevel& level : codec_levels()) {
    if (level.particle_stride > 16) continue;
    const std::int64_t frames = kept_frames(motion, level), n = kept_particles(motion, level);
    const Stream stream = encode_positions(motion, box, level);
    const auto x = decode_positions(stream, frames, n, box, level.position_bits);
    const double half = 0.5001 * box.side / ((1 << level.position_bits) - 1);
    for (std::int64_t f = 0; f < frames; ++f) {
      for (std::int64_t p = 0; p < n; ++p) {
        for (int k = 0; k < 3; ++k) {
          const auto from = static_cast<std::size_t>(
              3 * (f * level.frame_stride * 50 + p * level.particle_stride) + k);
          ASSERT_NEAR(x[static_cast<std::size_t>(3 * (f * n + p) + k)], motion.x[from], half);
        }
      }
    }
  }
}

TEST(ReportCodec, LevelsGrowCoarser) {
  const auto levels = codec_levels();
  const Motion motion = example_motion(300, 30);
  const Box box = box_of({motion});
  EXPECT_GT(encode_positions(motion, box, levels[0]).least_size(),
            encode_positions(motion, box, levels[5]).least_size());
  EXPECT_EQ(levels.front().position_bits, 16);
  EXPECT_GE(levels.back().particle_stride, 4096);
}

TEST(ReportCodec, HiddenParticlesStayWhereTheyWereAndAreMarked) {
  Motion motion = example_motion(4, 5);
  for (const int f : {0, 1, 3}) {
    for (int k = 0; k < 3; ++k) motion.x[static_cast<std::size_t>(12 * f + 3 * 2 + k)] = NAN;
  }
  const CodecLevel level;
  const Stream hidden = encode_hidden(motion, level);
  unsigned char now[4] = {};
  for (int f = 0; f < 5; ++f) {
    for (int p = 0; p < 4; ++p) {
      now[p] = static_cast<unsigned char>(
          now[p] + static_cast<unsigned char>(hidden.low[static_cast<std::size_t>(4 * f + p)]));
      EXPECT_EQ(now[p], p == 2 && (f == 0 || f == 1 || f == 3) ? 1 : 0) << f << " " << p;
    }
  }
  const Box box = box_of({motion});
  const auto x = decode_positions(encode_positions(motion, box, level), 5, 4, box, 16);
  for (int k = 0; k < 3; ++k) EXPECT_EQ(x[12 * 3 + 6 + k], x[12 * 2 + 6 + k]);
  EXPECT_TRUE(encode_hidden(example_motion(4, 5), level).low.empty());
}

TEST(ReportCodec, NothingButHiddenParticlesHasABox) {
  Motion motion = example_motion(2, 1);
  motion.x.assign(6, NAN);
  EXPECT_EQ(box_of({motion}).side, 1);
  EXPECT_EQ(box_of({}).side, 1);
}

TEST(ReportCodec, ValuesTakeTheirPlaceOnTheScaleAndNanNone) {
  Motion motion = example_motion(5, 1);
  const std::vector<float> values{1e-6F, 1e-4F, 1e-2F, NAN, 1};
  const Stream stream = encode_values(motion, values, {1e-6, 1e-2, true}, CodecLevel());
  EXPECT_EQ(stream.low, std::string("\x01\x80\xff\x00\xff", 5));
}

TEST(ReportCodec, BytesComeBackFromCompression) {
  std::string bytes(100'000, '\0');
  for (std::size_t i = 0; i < bytes.size(); i += 7) bytes[i] = static_cast<char>(i * i);
  EXPECT_EQ(inflated(deflated(bytes)), bytes);
  EXPECT_EQ(inflated(deflated("")), "");
  EXPECT_LT(deflated(bytes).size(), bytes.size() / 2);
}

TEST(ReportCodec, Base64IsThatOfTheStandard) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("\xff\xfe\xfd"), "//79");
}

}  // namespace
}  // namespace uniphy
