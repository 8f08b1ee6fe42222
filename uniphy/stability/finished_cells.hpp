#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "uniphy/stability/stability_cell.hpp"

namespace uniphy::stability {

/// The cells that a run has finished, on disk: one file each, under a name that holds a hash of all
/// that the cell depends on, so that a run resumes and another setting never reads it.
class FinishedCells {
 public:
  /// Makes the folder.
  explicit FinishedCells(std::filesystem::path folder);

  /// Nothing where it is not finished. `settings`: everything that the numbers depend on besides
  /// stressor, method and setting. Throws Error naming the file where it is damaged.
  std::optional<Cell> find(const std::string& stressor, const std::string& method,
                           const std::string& setting, const std::string& settings) const;
  void keep(const Cell& cell, const std::string& settings) const;

 private:
  std::filesystem::path file(const std::string& stressor, const std::string& method,
                             const std::string& setting, const std::string& settings) const;
  std::filesystem::path folder_;
};

}  // namespace uniphy::stability
