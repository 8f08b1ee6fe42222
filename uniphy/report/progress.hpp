#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace uniphy {

/// Done, total, rate and time left on stderr: one line rewritten in place on a terminal, otherwise
/// a plain line every 5 s. Work that ends within a second prints nothing but on a terminal.
class Progress {
 public:
  /// `unit` names what is counted ("steps"). A total of 0 is unknown.
  Progress(std::string label, std::int64_t total, std::string unit = "steps");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Sets the count; `note` follows the numbers ("loss 3.1e-4"). Cheap enough for every step.
  /// Throws Interrupted where the user asked the program to stop (see interrupt.hpp).
  void update(std::int64_t done, const std::string& note = "");
  /// Ends the line. Called by the destructor too.
  void finish();
  /// The line for a moment, as update() would print it.
  std::string line(std::int64_t done, double seconds, const std::string& note) const;

 private:
  void print(double seconds);

  std::string label_;
  std::string unit_;
  std::int64_t total_;
  std::int64_t done_ = 0;
  std::string note_;
  std::chrono::steady_clock::time_point start_;
  double next_print_ = 0;
  bool terminal_;
  bool open_line_ = false;
  bool finished_ = false;
};

}  // namespace uniphy
