#include "uniphy/report/metrics.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {

void Metrics::set(const std::string& name, double value) {
  if (name.empty() || name.find_first_of(" \t\n\"\\") != std::string::npos) {
    throw std::logic_error(fmt::format("\"{}\" is not the name of a metric", name));
  }
  for (auto& entry : entries_) {
    if (entry.first == name) {
      entry.second = value;
      return;
    }
  }
  entries_.emplace_back(name, value);
}

std::optional<double> Metrics::find(const std::string& name) const {
  for (const auto& entry : entries_) {
    if (entry.first == name) return entry.second;
  }
  return std::nullopt;
}

void Metrics::add_resources(std::chrono::steady_clock::time_point start) {
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  set("wall_s", wall.count());
  set("peak_memory_mb", peak_memory_mb());
}

std::string Metrics::json() const {
  nlohmann::ordered_json object = nlohmann::ordered_json::object();
  for (const auto& [name, value] : entries_) {
    // Counts and flags as integers: 1 rather than 1.0.
    const bool whole = std::isfinite(value) && value == std::floor(value) && std::abs(value) < 1e15;
    if (!std::isfinite(value)) {
      object[name] = nullptr;
    } else if (whole) {
      object[name] = static_cast<std::int64_t>(value);
    } else {
      object[name] = value;
    }
  }
  return object.dump(2) + "\n";
}

void Metrics::write(const std::filesystem::path& file) const { write_text_file(file, json()); }

Metrics Metrics::read(const std::filesystem::path& file) {
  const std::string text = read_text_file(file);
  nlohmann::ordered_json object;
  try {
    object = nlohmann::ordered_json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: not valid JSON: {}", file.string(), error.what()));
  }
  if (!object.is_object()) {
    throw Error(fmt::format("{}: expected an object of numbers, found {}", file.string(),
                            object.type_name()));
  }
  Metrics metrics;
  for (const auto& [name, value] : object.items()) {
    if (!value.is_number() && !value.is_null()) {
      throw Error(fmt::format("{}: {}: expected a number or null, found {}", file.string(), name,
                              value.type_name()));
    }
    metrics.entries_.emplace_back(
        name, value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>());
  }
  return metrics;
}

double peak_memory_mb() {
  // VmHWM counts this program alone; ru_maxrss starts at what the parent had when it forked.
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (word == "VmHWM:") {
      double kib = 0;
      if (status >> kib) return kib / 1024;
    }
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace uniphy
