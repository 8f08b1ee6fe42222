#include "uniphy/report/report_payload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/report_text.hpp"

namespace uniphy {
namespace {

using Json = nlohmann::ordered_json;

/// Below this nothing flows that one would see; and no noise of an elastic body fills the scale.
constexpr double kLeastStrain = 0.05;
/// Decades of the scale of errors.
constexpr double kErrorDecades = 4;

/// Collects streams: only how long they will be, or the elements of the page as well.
class Blobs {
 public:
  explicit Blobs(bool write) : write_(write) {}

  /// Its number in the page.
  int add(const std::string& bytes, double least_size) {
    least_size_ += least_size * 4 / 3;
    if (write_) {
      html_ += fmt::format("<script type=\"text/plain\" id=\"blob-{}\">{}</script>\n", count_,
                           base64(deflated(bytes)));
    }
    return count_++;
  }
  Json add(const Stream& stream) {
    if (stream.low.empty()) return nullptr;
    if (stream.high.empty()) return add(stream.low, stream.least_size());
    return add(stream.low + stream.high, stream.least_size());
  }
  double least_size() const { return least_size_; }
  const std::string& html() const { return html_; }

 private:
  bool write_;
  int count_ = 0;
  double least_size_ = 0;
  std::string html_;
};

/// The value that all but a thousandth stay below.
double high_of(const std::vector<Playback>& playbacks, std::vector<float> Motion::*values) {
  std::vector<float> all;
  for (const Playback& playback : playbacks) {
    for (const Motion& motion : playback.motions) {
      for (const float value : motion.*values) {
        if (std::isfinite(value)) all.push_back(value);
      }
    }
  }
  if (all.empty()) return 0;
  const auto at = all.begin() + static_cast<std::ptrdiff_t>(0.999 * double(all.size() - 1));
  std::nth_element(all.begin(), at, all.end());
  return *at;
}

struct Scales {
  Scale strain, error;
};

/// Of one playback: what stands side by side has one scale.
Scales scales_of(const Playback& playback) {
  Scales scales;
  scales.strain = {0, std::max(kLeastStrain, high_of({playback}, &Motion::plastic_strain)), false};
  const double error = high_of({playback}, &Motion::error);
  // Equal motions have no error; any scale shows that.
  const double high = error > 0 ? error : 1e-6;
  scales.error = {high / std::pow(10, kErrorDecades), high, true};
  return scales;
}

Json scale_json(const Scale& scale) {
  return {{"low", scale.low}, {"high", scale.high}, {"log", scale.log}};
}

Stream bodies_of(const Motion& motion, const CodecLevel& level) {
  Stream stream;
  for (std::int64_t p = 0; p < motion.particles; p += level.particle_stride) {
    stream.low += static_cast<char>(motion.body[static_cast<std::size_t>(p)] % 256);
  }
  return stream;
}

Json motion_json(const Motion& motion, const Box& box, const Scales& scales,
                 const CodecLevel& level, Blobs& blobs) {
  Json json;
  json["name"] = motion.name;
  json["frames"] = kept_frames(motion, level);
  json["particles"] = kept_particles(motion, level);
  std::vector<double> time;
  for (std::int64_t f = 0; f < motion.frames(); f += level.frame_stride) {
    time.push_back(motion.time[static_cast<std::size_t>(f)]);
  }
  json["time"] = time;
  json["body"] = blobs.add(bodies_of(motion, level));
  json["positions"] = blobs.add(encode_positions(motion, box, level));
  json["hidden"] = blobs.add(encode_hidden(motion, level));
  json["strain"] = nullptr;
  json["error"] = nullptr;
  if (!motion.plastic_strain.empty()) {
    json["strain"] = blobs.add(encode_values(motion, motion.plastic_strain, scales.strain, level));
  }
  if (!motion.error.empty()) {
    json["error"] = blobs.add(encode_values(motion, motion.error, scales.error, level));
  }
  json["reference"] = motion.reference;
  return json;
}

Json playback_json(const Playback& playback, const CodecLevel& level, Blobs& blobs) {
  const Box box = box_of(playback.motions);
  const Scales scales = scales_of(playback);
  Json json;
  json["title"] = playback.title;
  json["bodies"] = playback.bodies;
  json["walls"] = {playback.low, playback.high};
  json["low"] = {box.low[0], box.low[1], box.low[2]};
  json["side"] = box.side;
  json["positionBits"] = level.position_bits;
  json["valueBits"] = level.value_bits;
  json["strainScale"] = scale_json(scales.strain);
  json["errorScale"] = scale_json(scales.error);
  json["note"] = payload_note(playback, level);
  json["motions"] = Json::array();
  for (const Motion& motion : playback.motions) {
    json["motions"].push_back(motion_json(motion, box, scales, level, blobs));
  }
  return json;
}

std::string playbacks_json(const std::vector<Playback>& playbacks, const CodecLevel& level,
                           Blobs& blobs) {
  Json json = Json::array();
  for (const Playback& playback : playbacks) {
    json.push_back(playback_json(playback, level, blobs));
  }
  return script_json(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

ReportPayload payload_of(const std::vector<Playback>& playbacks, std::size_t room) {
  for (const CodecLevel& level : codec_levels()) {
    // Entropy is counted at once; compression takes seconds.
    Blobs estimate(false);
    const std::string json = playbacks_json(playbacks, level, estimate);
    if (estimate.least_size() + double(json.size()) > double(room)) continue;
    Blobs blobs(true);
    playbacks_json(playbacks, level, blobs);
    ReportPayload payload{json, blobs.html(), level};
    if (payload.size() <= room) return payload;
  }
  throw Error(
      fmt::format("report: expected motions that fit into {} bytes, found none that do", room));
}

std::string payload_note(const Playback& playback, const CodecLevel& level) {
  const double side = box_of(playback.motions).side;
  std::string note = fmt::format("Positions are rounded to {:.2g} mm",
                                 1e3 * side / ((1 << level.position_bits) - 1));
  std::int64_t frames = 1, particles = 1;
  for (const Motion& motion : playback.motions) {
    frames = std::max(frames, motion.frame_stride * level.frame_stride);
    particles = std::max(particles, motion.particle_stride * level.particle_stride);
  }
  if (frames > 1) note += fmt::format("; one of {} frames is shown", frames);
  if (particles > 1) note += fmt::format("; one of {} particles is shown", particles);
  return note + ".";
}

}  // namespace uniphy
