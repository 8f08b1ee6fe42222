#pragma once

// What stands in a directory, to tell afterwards what a run has written there.

#include <cstdint>
#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

namespace uniphy {

class DirectoryListing {
 public:
  /// Everything below the directory, as it is now; nothing where there is no such directory.
  explicit DirectoryListing(std::filesystem::path directory);
  bool operator==(const DirectoryListing& other) const { return entries_ == other.entries_; }

  /// The files that are new here or have changed since `before`: those of the directory itself by
  /// name, "folder/ (3 files)" for those of a folder in it, sorted.
  std::vector<std::string> changed_since(const DirectoryListing& before) const;

 private:
  using Entry = std::tuple<std::filesystem::path, std::filesystem::file_time_type, std::uintmax_t>;
  std::filesystem::path directory_;
  std::vector<Entry> entries_;  ///< sorted; the size of a folder is 0
};

/// "a, b, c and 4 more": the first `most` of the names.
std::string joined_names(const std::vector<std::string>& names, std::size_t most);

}  // namespace uniphy
