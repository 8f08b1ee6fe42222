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

/// The value that this share of all stays below.
double high_of(const Playback& playback, std::vector<float> Motion::*values, double share) {
  std::vector<float> all;
  for (const Motion& motion : playback.motions) {
    for (const float value : motion.*values) {
      if (std::isfinite(value)) all.push_back(value);
    }
  }
  if (all.empty()) return 0;
  const auto at = all.begin() + static_cast<std::ptrdiff_t>(share * double(all.size() - 1));
  std::nth_element(all.begin(), at, all.end());
  return *at;
}

/// A playback, and what stands side by side in it has in common.
struct Shown {
  explicit Shown(const Playback& shown) : playback(shown), box(box_of(shown.motions)) {
    strain = {0, std::max(kLeastStrain, high_of(shown, &Motion::plastic_strain, 0.98)), false};
    const double largest = high_of(shown, &Motion::error, 0.999);
    // Equal motions have no error; any scale shows that.
    const double high = largest > 0 ? largest : 1e-6;
    error = {high / std::pow(10, kErrorDecades), high, true};
  }

  const Playback& playback;
  Box box;
  Scale strain, error;
};

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

Json motion_json(const Motion& motion, const Shown& shown, const CodecLevel& level, Blobs& blobs) {
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
  json["positions"] = blobs.add(encode_positions(motion, shown.box, level));
  json["hidden"] = blobs.add(encode_hidden(motion, level));
  json["strain"] = nullptr;
  json["error"] = nullptr;
  if (!motion.plastic_strain.empty()) {
    json["strain"] = blobs.add(encode_values(motion, motion.plastic_strain, shown.strain, level));
  }
  if (!motion.error.empty()) {
    json["error"] = blobs.add(encode_values(motion, motion.error, shown.error, level));
  }
  json["reference"] = motion.reference;
  json["cloud"] = motion.cloud;
  return json;
}

/// What the page says of what was rounded and left out.
std::string note_of(const Shown& shown, const CodecLevel& level) {
  std::string note = fmt::format("Positions are rounded to {:.2g} mm",
                                 1e3 * shown.box.side / ((1 << level.position_bits) - 1));
  std::int64_t frames = 1, particles = 1;
  for (const Motion& motion : shown.playback.motions) {
    frames = std::max(frames, motion.frame_stride * level.frame_stride);
    particles = std::max(particles, motion.particle_stride * level.particle_stride);
  }
  if (frames > 1) note += fmt::format("; one of {} frames is shown", frames);
  if (particles > 1) note += fmt::format("; one of {} particles is shown", particles);
  return note + ".";
}

Json playback_json(const Shown& shown, const CodecLevel& level, Blobs& blobs) {
  const Playback& playback = shown.playback;
  Json json;
  json["title"] = playback.title;
  json["bodies"] = playback.bodies;
  json["walls"] = {playback.low, playback.high};
  json["low"] = {shown.box.low[0], shown.box.low[1], shown.box.low[2]};
  json["side"] = shown.box.side;
  json["positionBits"] = level.position_bits;
  json["valueBits"] = level.value_bits;
  json["strainScale"] = scale_json(shown.strain);
  json["errorScale"] = scale_json(shown.error);
  json["note"] = note_of(shown, level);
  json["motions"] = Json::array();
  for (const Motion& motion : playback.motions) {
    if (motion.frames() == 0 || motion.particles == 0) continue;  // nothing to see
    json["motions"].push_back(motion_json(motion, shown, level, blobs));
  }
  return json;
}

std::string playbacks_json(const std::vector<Shown>& all, const CodecLevel& level, Blobs& blobs) {
  Json json = Json::array();
  for (const Shown& shown : all) json.push_back(playback_json(shown, level, blobs));
  return script_json(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

ReportPayload payload_of(const std::vector<Playback>& playbacks, std::size_t room) {
  const std::vector<Shown> shown(playbacks.begin(), playbacks.end());
  for (const CodecLevel& level : codec_levels()) {
    // Entropy is counted at once; compression takes seconds.
    Blobs estimate(false);
    const std::string json = playbacks_json(shown, level, estimate);
    if (estimate.least_size() + double(json.size()) > double(room)) continue;
    Blobs blobs(true);
    playbacks_json(shown, level, blobs);
    ReportPayload payload{json, blobs.html(), level};
    if (payload.size() <= room) return payload;
  }
  throw Error(
      fmt::format("report: expected motions that fit into {} bytes, found none that do", room));
}

}  // namespace uniphy
