#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "uniphy/evaluation/forecast.hpp"
#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// The fits that an evaluation has finished, on disk: DIR/fits, each under a name that holds a hash
/// of all that it depends on.
class FinishedFits {
 public:
  /// Makes the folder.
  explicit FinishedFits(const RunDirectory& out);

  /// Where a fit of that name is kept, without an ending.
  std::filesystem::path stem(const std::string& name, const Observation& seen,
                             const FitVariables& variables) const;
  /// So that the fit resumes where it was interrupted.
  static FitHooks hooks(const std::filesystem::path& stem);
  /// Keeps what it came to, and the seconds it took, and removes its state.
  static void write(const std::filesystem::path& stem, const Forecast& result, double seconds);
  static void write(const std::filesystem::path& stem, const Metrics& result);
  /// Nothing where it is not finished. Throws Error where the file is damaged.
  static std::optional<Metrics> read(const std::filesystem::path& stem);
  /// False where it is not finished. Throws Error where the file is damaged.
  static bool read(const std::filesystem::path& stem, Forecast& result, double& seconds);

 private:
  std::filesystem::path folder_;
  std::string settings_;
};

}  // namespace uniphy
