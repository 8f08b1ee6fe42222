#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "uniphy/report/report.hpp"
#include "uniphy/report/report_codec.hpp"

namespace uniphy {

/// The motions of a page: a description as JSON, and <script> elements that hold the numbers.
struct ReportPayload {
  std::string json;   ///< a list of playbacks, see motion.js
  std::string blobs;  ///< HTML
  CodecLevel level;

  std::size_t size() const { return json.size() + blobs.size(); }
};

/// At the finest level at which it takes at most `room` bytes. Throws Error where there is none.
ReportPayload payload_of(const std::vector<Playback>& playbacks, std::size_t room);

}  // namespace uniphy
