#pragma once

#include <chrono>
#include <deque>
#include <filesystem>
#include <string>

#include "uniphy/inference/fit.hpp"

namespace uniphy {

/// A point on its way down a rung.
struct RungTask {
  std::string name;       ///< unique within a run
  std::string optimizer;  ///< its state after `steps`; empty: it has not begun
  int steps = 0;
  bool done = false;
  int roll_outs = 0;
  double seconds = 0;  ///< that it took, interrupted runs included
};

/// What an adaptation has done so far, on disk (HDF5, format "uniphy-adaptation-state"). The order
/// of its tasks follows from their results, so that a run that goes on repeats its decisions,
/// finds what is done and resumes the task under way.
class AdaptationState {
 public:
  /// Reads the file where there is one. Throws Error where it is damaged or its fingerprint is
  /// another. An empty path: nothing is read or written.
  AdaptationState(const std::filesystem::path& file, const FitHooks& hooks);

  /// The task of that name, which begins where there is none yet.
  RungTask& task(const std::string& name);
  /// Writes the file where it is time to, or `now`; then throws Interrupted where the user asked
  /// for it.
  void checkpoint(bool now);
  const std::filesystem::path& file() const { return file_; }

 private:
  void read();
  void write() const;

  std::filesystem::path file_;
  const FitHooks& hooks_;
  std::deque<RungTask> tasks_;
  std::chrono::steady_clock::time_point saved_ = std::chrono::steady_clock::now();
};

/// Where the state of the adaptation is kept, beside that of the fit of z; empty for an empty path.
std::filesystem::path adaptation_state_file(const std::filesystem::path& state_file);

}  // namespace uniphy
