#include "uniphy/bench/added_memory.hpp"

#include <algorithm>
#include <fstream>
#include <string>

#include "uniphy/report/metrics.hpp"

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace uniphy::bench {
namespace {

/// A line of /proc/self/status in MiB, or the fallback.
double status_mb(const std::string& key, double fallback) {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    if (line.rfind(key + ":", 0) == 0) return std::stod(line.substr(key.size() + 1)) / 1024;
  }
  return fallback;
}

}  // namespace

AddedMemory::AddedMemory() {
#if defined(__GLIBC__)
  ::malloc_trim(0);
#endif
  std::ofstream reset("/proc/self/clear_refs");
  const bool done = static_cast<bool>(reset << "5" << std::flush);  // the peak becomes VmRSS
  before_ = done ? status_mb("VmRSS", peak_memory_mb()) : peak_memory_mb();
}

double AddedMemory::peak_mb() const { return std::max(0.0, peak_memory_mb() - before_); }

}  // namespace uniphy::bench
