#include "uniphy/report/directory_listing.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

namespace uniphy {

DirectoryListing::DirectoryListing(std::filesystem::path directory)
    : directory_(std::move(directory)) {
  std::error_code ignored;
  std::filesystem::recursive_directory_iterator at(directory_, ignored), end;
  for (; at != end; at.increment(ignored)) {
    const bool file = at->is_regular_file(ignored);
    entries_.emplace_back(at->path(), at->last_write_time(ignored),
                          file ? at->file_size(ignored) : 0);
  }
  std::sort(entries_.begin(), entries_.end());
}

std::vector<std::string> DirectoryListing::changed_since(const DirectoryListing& before) const {
  std::vector<std::string> names;
  std::map<std::string, int> folders;
  std::error_code ignored;
  for (const Entry& entry : entries_) {
    if (std::binary_search(before.entries_.begin(), before.entries_.end(), entry)) continue;
    const std::filesystem::path& path = std::get<0>(entry);
    if (std::filesystem::is_directory(path, ignored)) continue;
    const std::filesystem::path below = path.lexically_relative(directory_);
    if (below.has_parent_path()) {
      ++folders[below.begin()->string()];
    } else {
      names.push_back(below.string());
    }
  }
  for (const auto& [folder, files] : folders)
    names.push_back(fmt::format("{}/ ({} file{})", folder, files, files == 1 ? "" : "s"));
  std::sort(names.begin(), names.end());
  return names;
}

std::string joined_names(const std::vector<std::string>& names, std::size_t most) {
  const std::size_t shown = std::min(names.size(), most);
  std::string text = fmt::format("{}", fmt::join(names.begin(), names.begin() + shown, ", "));
  if (shown < names.size()) text += fmt::format(" and {} more", names.size() - shown);
  return text;
}

}  // namespace uniphy
