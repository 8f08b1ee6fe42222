#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "uniphy/report/report.hpp"

namespace uniphy {

/// Writes report.html at the end of a run, where it is asked for.
class ReportWriter {
 public:
  /// Looks for what it needs now, not when the work is done. Throws Error.
  ReportWriter(bool asked, const std::string& name, const std::string& summary,
               const std::string& source);
  /// What the run collects in; null where no report is asked for.
  const std::shared_ptr<Report>& report() const { return report_; }

  void write(const std::filesystem::path& file, const std::string& config, const Metrics& metrics);
  /// To be called where an exception is handled: what a run that failed has to show, and why it
  /// failed. Throws nothing that would hide that.
  void write_failed(const std::filesystem::path& file, const std::string& config,
                    const Metrics& metrics);

 private:
  std::shared_ptr<Report> report_;
  std::string three_js_;
  ReportRun run_;
};

}  // namespace uniphy
