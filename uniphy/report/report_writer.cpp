#include "uniphy/report/report_writer.hpp"

#include <cstdio>
#include <exception>

#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

/// The first line of the exception that is being handled.
std::string current_failure() {
  try {
    throw;
  } catch (const std::exception& error) {
    const std::string text = error.what();
    return text.substr(0, text.find('\n'));
  } catch (...) {
    return "unknown error";
  }
}

}  // namespace

ReportWriter::ReportWriter(bool asked, const std::string& name, const std::string& summary,
                           const std::string& source) {
  if (!asked) return;
  three_js_ = find_three_js();
  report_ = std::make_shared<Report>();
  run_.name = name;
  run_.summary = summary;
  run_.source = source;
}

void ReportWriter::write(const std::filesystem::path& file, const std::string& config,
                         const Metrics& metrics) {
  if (!report_) return;
  run_.config = config;
  run_.metrics = metrics;
  write_text_file(file, report_html(*report_, run_, three_js_));
}

void ReportWriter::write_failed(const std::filesystem::path& file, const std::string& config,
                                const Metrics& metrics) {
  if (!report_ || report_->empty()) return;
  run_.failure = current_failure();
  try {
    write(file, config, metrics);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "warning: no report: %s\n", error.what());
  }
}

}  // namespace uniphy
