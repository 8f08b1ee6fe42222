#include "uniphy/report/report_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace uniphy {
namespace {

/// Huffman's code and the repeats that deflate finds, against the entropy: up to 3 % longer on the
/// motions of the README, and shorter where many bytes are equal.
double entropy(const std::string& bytes) {
  std::array<std::int64_t, 256> count{};
  for (const char c : bytes) ++count[static_cast<unsigned char>(c)];
  double bits = 0;
  for (const std::int64_t count_of_one : count) {
    const auto n = static_cast<double>(count_of_one);
    if (n > 0) bits -= n * std::log2(n / static_cast<double>(bytes.size()));
  }
  return bits / 8;
}

std::uint16_t alternating(std::uint16_t difference) {
  const auto value = static_cast<std::int16_t>(difference);
  return static_cast<std::uint16_t>(value < 0 ? -2 * value - 1 : 2 * value);
}

std::uint16_t difference_of(std::uint16_t code) {
  const int half = code >> 1;
  return static_cast<std::uint16_t>(code & 1 ? -half - 1 : half);
}

std::uint16_t quantised(double x, double low, double side, int bits) {
  const double top = (1 << bits) - 1;
  return static_cast<std::uint16_t>(std::clamp((x - low) / side, 0.0, 1.0) * top + 0.5);
}

/// The whole numbers of one frame, [3, particles]; hidden ones stay as they are in `q`.
void quantise_frame(const Motion& motion, std::int64_t frame, const Box& box,
                    const CodecLevel& level, std::vector<std::uint16_t>& q) {
  const std::int64_t n = kept_particles(motion, level);
  for (std::int64_t p = 0; p < n; ++p) {
    const std::int64_t from = frame * motion.particles + p * level.particle_stride;
    const float* x = motion.x.data() + 3 * from;
    if (!std::isfinite(x[0] + x[1] + x[2])) continue;
    for (int k = 0; k < 3; ++k) {
      q[static_cast<std::size_t>(k * n + p)] =
          quantised(x[k], box.low[k], box.side, level.position_bits);
    }
  }
}

/// The number expected at `i` from the frames before, `frame` of them.
std::uint16_t expected(std::int64_t frame, std::size_t i, const std::vector<std::uint16_t>& now,
                       const std::vector<std::uint16_t>& last,
                       const std::vector<std::uint16_t>& before) {
  if (frame == 0) return i == 0 ? 0 : now[i - 1];
  if (frame == 1) return last[i];
  return static_cast<std::uint16_t>(2 * last[i] - before[i]);
}

double place_on(const Scale& scale, double value) {
  if (!(scale.high > scale.low)) return 0;
  const double at = scale.log ? std::log(std::max(value, scale.low) / scale.low) /
                                    std::log(scale.high / scale.low)
                              : (value - scale.low) / (scale.high - scale.low);
  return std::clamp(at, 0.0, 1.0);
}

/// A stream of one byte a kept particle and frame, as the difference from the frame before.
template <class Code>
Stream encode_bytes(const Motion& motion, const CodecLevel& level, const Code& code) {
  const std::int64_t n = kept_particles(motion, level);
  std::vector<unsigned char> last(static_cast<std::size_t>(n), 0);
  Stream stream;
  for (std::int64_t f = 0; f < kept_frames(motion, level); ++f) {
    for (std::int64_t p = 0; p < n; ++p) {
      const auto from = static_cast<std::size_t>(f * level.frame_stride * motion.particles +
                                                 p * level.particle_stride);
      unsigned char& before = last[static_cast<std::size_t>(p)];
      const unsigned char now = code(from);
      stream.low += static_cast<char>(now - before);
      before = now;
    }
  }
  return stream;
}

}  // namespace

std::vector<CodecLevel> codec_levels() {
  std::vector<CodecLevel> levels;
  for (const auto& [positions, values] :
       {std::pair{16, 8}, {15, 8}, {14, 7}, {13, 7}, {12, 6}, {11, 6}}) {
    levels.push_back({positions, values, 1, 1});
  }
  for (std::int64_t stride = 2; stride <= 32; stride *= 2) levels.push_back({12, 6, stride, 1});
  for (std::int64_t stride = 2; stride <= 4096; stride *= 2) levels.push_back({12, 6, 32, stride});
  return levels;
}

double Stream::least_size() const { return entropy(low) + entropy(high); }

Box box_of(const std::vector<Motion>& motions) {
  Box box{{1e300, 1e300, 1e300}, 0};
  double high[3] = {-1e300, -1e300, -1e300};
  for (const Motion& motion : motions) {
    for (std::size_t i = 0; i < motion.x.size(); ++i) {
      if (!std::isfinite(motion.x[i])) continue;
      box.low[i % 3] = std::min<double>(box.low[i % 3], motion.x[i]);
      high[i % 3] = std::max<double>(high[i % 3], motion.x[i]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    if (high[k] < box.low[k]) return {{0, 0, 0}, 1};  // nothing is to be seen
    box.side = std::max(box.side, high[k] - box.low[k]);
  }
  if (box.side == 0) box.side = 1;
  return box;
}

std::int64_t kept_frames(const Motion& motion, const CodecLevel& level) {
  return (motion.frames() + level.frame_stride - 1) / level.frame_stride;
}

std::int64_t kept_particles(const Motion& motion, const CodecLevel& level) {
  return (motion.particles + level.particle_stride - 1) / level.particle_stride;
}

Stream encode_positions(const Motion& motion, const Box& box, const CodecLevel& level) {
  const auto size = static_cast<std::size_t>(3 * kept_particles(motion, level));
  std::vector<std::uint16_t> before(size, 0), last(size, 0), now(size, 0);
  Stream stream;
  stream.low.reserve(static_cast<std::size_t>(kept_frames(motion, level)) * size);
  stream.high.reserve(stream.low.capacity());
  for (std::int64_t f = 0; f < kept_frames(motion, level); ++f) {
    quantise_frame(motion, f * level.frame_stride, box, level, now);
    for (std::size_t i = 0; i < size; ++i) {
      const std::uint16_t code =
          alternating(static_cast<std::uint16_t>(now[i] - expected(f, i, now, last, before)));
      stream.low += static_cast<char>(code & 0xFF);
      stream.high += static_cast<char>(code >> 8);
    }
    before = last;
    last = now;
  }
  return stream;
}

std::vector<double> decode_positions(const Stream& stream, std::int64_t frames,
                                     std::int64_t particles, const Box& box, int bits) {
  const auto size = static_cast<std::size_t>(3 * particles);
  std::vector<std::uint16_t> before(size, 0), last(size, 0), now(size, 0);
  std::vector<double> x(static_cast<std::size_t>(frames) * size);
  const double step = box.side / ((1 << bits) - 1);
  for (std::int64_t f = 0; f < frames; ++f) {
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t at = static_cast<std::size_t>(f) * size + i;
      const int code = static_cast<unsigned char>(stream.low[at]) |
                       static_cast<unsigned char>(stream.high[at]) << 8;
      now[i] = static_cast<std::uint16_t>(expected(f, i, now, last, before) +
                                          difference_of(static_cast<std::uint16_t>(code)));
      const std::size_t axis = i / static_cast<std::size_t>(particles);
      const std::size_t p = i % static_cast<std::size_t>(particles);
      x[static_cast<std::size_t>(f) * size + 3 * p + axis] = box.low[axis] + now[i] * step;
    }
    before = last;
    last = now;
  }
  return x;
}

Stream encode_hidden(const Motion& motion, const CodecLevel& level) {
  Stream stream = encode_bytes(motion, level, [&](std::size_t i) -> unsigned char {
    return std::isfinite(motion.x[3 * i]) ? 0 : 1;
  });
  const bool any = std::any_of(stream.low.begin(), stream.low.end(), [](char c) { return c != 0; });
  return any ? stream : Stream();
}

Stream encode_values(const Motion& motion, const std::vector<float>& values, const Scale& scale,
                     const CodecLevel& level) {
  const double top = (1 << level.value_bits) - 2;
  return encode_bytes(motion, level, [&](std::size_t i) -> unsigned char {
    const double value = values[i];
    if (!std::isfinite(value)) return 0;
    return static_cast<unsigned char>(1 + std::lround(place_on(scale, value) * top));
  });
}

}  // namespace uniphy
