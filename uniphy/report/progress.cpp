#include "uniphy/report/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "uniphy/report/interrupt.hpp"

namespace uniphy {
namespace {

constexpr double kTerminalPeriod = 0.1;  // s
constexpr double kPlainPeriod = 5;       // s

std::string duration_text(double seconds) {
  if (seconds < 60) return fmt::format("{:.0f} s", seconds);
  const auto whole = static_cast<std::int64_t>(seconds);
  if (whole < 3600) return fmt::format("{}:{:02} min", whole / 60, whole % 60);
  return fmt::format("{}:{:02} h", whole / 3600, whole / 60 % 60);
}

std::string rate_text(double rate) {
  return rate >= 100 ? fmt::format("{:.0f}", rate) : fmt::format("{:.3g}", rate);
}

}  // namespace

Progress::Progress(std::string label, std::int64_t total, std::string unit)
    : label_(std::move(label)),
      unit_(std::move(unit)),
      total_(total),
      start_(std::chrono::steady_clock::now()),
      terminal_(::isatty(STDERR_FILENO) == 1) {
  next_print_ = terminal_ ? kTerminalPeriod : kPlainPeriod;
}

Progress::~Progress() { finish(); }

void Progress::update(std::int64_t done, const std::string& note) {
  throw_if_interrupted();
  done_ = done;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
  if (elapsed.count() < next_print_) {
    if (!note.empty()) note_ = note;
    return;
  }
  note_ = note;
  next_print_ = elapsed.count() + (terminal_ ? kTerminalPeriod : kPlainPeriod);
  print(elapsed.count());
}

void Progress::print(double seconds) {
  const std::string text = line(done_, seconds, note_);
  if (terminal_) {
    std::fprintf(stderr, "\r\033[K%s", text.c_str());
    open_line_ = true;
  } else {
    std::fprintf(stderr, "%s\n", text.c_str());
  }
  std::fflush(stderr);
}

void Progress::finish() {
  if (finished_) return;
  finished_ = true;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
  if (done_ > 0 && (terminal_ || elapsed.count() >= 1)) print(elapsed.count());
  if (open_line_) std::fprintf(stderr, "\n");
}

std::string Progress::line(std::int64_t done, double seconds, const std::string& note) const {
  std::string text = label_ + ": ";
  if (total_ > 0) {
    text += fmt::format("{}/{} {} ({}%)", done, total_, unit_, 100 * done / total_);
  } else {
    text += fmt::format("{} {}", done, unit_);
  }
  if (done > 0 && seconds > 0) {
    const double rate = static_cast<double>(done) / seconds;
    text += fmt::format(", {}/s", rate_text(rate));
    text += total_ > done
                ? fmt::format(", {} left", duration_text(static_cast<double>(total_ - done) / rate))
                : fmt::format(", {}", duration_text(seconds));
  }
  return note.empty() ? text : text + ", " + note;
}

}  // namespace uniphy
