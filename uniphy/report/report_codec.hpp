#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "uniphy/report/report_motion.hpp"

namespace uniphy {

/// How finely motions are written, see codec_levels().
struct CodecLevel {
  int position_bits = 16;            ///< of a coordinate, over the largest side of what is shown
  int value_bits = 8;                ///< of a colour
  std::int64_t frame_stride = 1;     ///< every so many frames
  std::int64_t particle_stride = 1;  ///< every so many particles
};

/// From the finest to the coarsest: first fewer bits, then fewer frames, then fewer particles. The
/// coarsest positions that every frame is kept for are a 2048th of the side, half a pixel of a
/// large window.
std::vector<CodecLevel> codec_levels();

/// A stream of bytes for the page, before it is compressed. Differences of smooth motions are
/// small, so that `low` has few different bytes and `high` hardly any but zeros.
struct Stream {
  std::string low, high;

  /// What Huffman's code makes of it at least, in bytes.
  double least_size() const;
};

/// Where positions are counted from, and the largest side of their box, m.
struct Box {
  double low[3];
  double side;
};
Box box_of(const std::vector<Motion>& motions);

/// Whole numbers q = (x - low) / side (2^bits - 1), rounded; of each, for each frame, axis and
/// particle, the difference from 2 q' - q'' of the two frames before (frame 1: from q'; frame 0:
/// from the particle before), modulo 2^16, signs alternating (0, -1, 1, -2, …). A hidden particle
/// stands where it was last.
Stream encode_positions(const Motion& motion, const Box& box, const CodecLevel& level);
/// The positions that a page makes of it, [frames, particles, 3] m: what motion.js does.
std::vector<double> decode_positions(const Stream& stream, std::int64_t frames,
                                     std::int64_t particles, const Box& box, int bits);

/// A byte a particle and frame: 1 where it is hidden; empty where none ever is.
Stream encode_hidden(const Motion& motion, const CodecLevel& level);

/// The scale of a colour; logarithmic or linear.
struct Scale {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  bool log = false;
};
/// A byte a particle and frame, the difference from the frame before: 0 where the value is not
/// known, else 1 + round(place on the scale times (2^bits - 2)).
Stream encode_values(const Motion& motion, const std::vector<float>& values, const Scale& scale,
                     const CodecLevel& level);

/// Frames and particles that are left at a level.
std::int64_t kept_frames(const Motion& motion, const CodecLevel& level);
std::int64_t kept_particles(const Motion& motion, const CodecLevel& level);

/// zlib's format (RFC 1950), and back.
std::string deflated(const std::string& bytes);
std::string inflated(const std::string& bytes);
std::string base64(const std::string& bytes);

}  // namespace uniphy
