#pragma once

// report.html: what a run found, in one file that opens in a browser, from a disk, without a
// server and without anything fetched: tables, charts to read off, motions to play, the numbers and
// the resolved configuration. A run collects in a Report what it makes anyway (RunDirectory::draw,
// write_table, report()); run_experiment writes the file at the end.
//
// The page's own text is in uniphy/report/page; three.js, which draws the motions, is read from the
// system when the report is written (find_three_js) and stands in the file.

#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/report/metrics.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/report/report_motion.hpp"

namespace uniphy {

/// A table in Markdown with the text around it; or, without any |, text with its line breaks.
struct ReportTable {
  std::string title;
  std::string text;
};

/// Motions that are played side by side and seen by one camera.
struct Playback {
  std::string title;
  std::vector<Motion> motions;
  std::vector<std::string> bodies = {};  ///< names of the bodies, or none
  double low = 0, high = 1;              ///< m, the walls are those of the cube [low, high]^3
};

/// What a run shows besides its configuration and its metrics.
struct Report {
  std::vector<ReportTable> tables;
  std::vector<Playback> playbacks;
  std::vector<Chart> charts;

  /// In place of the table of the same title, if there is one.
  void set_table(const std::string& title, const std::string& text);
  bool empty() const { return tables.empty() && playbacks.empty() && charts.empty(); }
};

/// What is told of the run itself.
struct ReportRun {
  std::string name;     ///< "uniphy_identify"
  std::string summary;  ///< what it does
  std::string source;   ///< the configuration file that it was called with
  std::string config;   ///< resolved, YAML
  std::string failure;  ///< why it ended before its time; empty: it did not
  Metrics metrics;      ///< may be empty
};

/// The most bytes of a report. Motions are written more coarsely until they fit, see
/// codec_levels(), and the page says how coarsely.
inline constexpr std::size_t kReportBytes = 20'000'000;

/// The page. The same arguments give the same bits. Throws Error where the rest alone is too large.
std::string report_html(const Report& report, const ReportRun& run, const std::string& three_js,
                        std::size_t maximum_bytes = kReportBytes);

/// Where three.js is read from instead, if set.
inline constexpr const char* kThreeJsVariable = "UNIPHY_THREE_JS";
/// The text of three.js: of the file named by the environment variable UNIPHY_THREE_JS, or of
/// Debian's package libjs-three. Throws Error that names the package where there is none.
std::string find_three_js();
/// The same, of the first of these files that is there.
std::string find_three_js(const std::vector<std::filesystem::path>& files);

}  // namespace uniphy
