#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace uniphy {

/// metrics.json: a flat object, name → number. What is not finite is written as null (JSON has no
/// NaN), so that a consumer sees that a number was due and is not there.
class Metrics {
 public:
  /// Sets or replaces; the order of first setting is kept. Names hold no blanks or quotes.
  void set(const std::string& name, double value);
  std::optional<double> find(const std::string& name) const;
  const std::vector<std::pair<std::string, double>>& entries() const { return entries_; }

  /// Adds `wall_s` (since `start`) and `peak_memory_mb` (of this process so far).
  void add_resources(std::chrono::steady_clock::time_point start);

  std::string json() const;
  void write(const std::filesystem::path& file) const;
  /// Throws Error unless the file is a flat object of numbers and nulls (null reads as NaN).
  static Metrics read(const std::filesystem::path& file);

 private:
  std::vector<std::pair<std::string, double>> entries_;
};

/// Largest resident set of this process so far, in MiB: VmHWM of /proc/self/status, or getrusage
/// where that is not there.
double peak_memory_mb();

}  // namespace uniphy
