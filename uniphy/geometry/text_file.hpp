#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace uniphy {

/// The whole file. Throws Error where it cannot be read, is a folder, or is larger than 1 GiB.
std::string read_text_file(const std::filesystem::path& file);

/// Calls `visit` with the number of each line (from 1) and the line without its end.
void for_each_line(const std::string& text,
                   const std::function<void(std::int64_t, std::string_view)>& visit);

/// The words between runs of any of the `separators`.
std::vector<std::string_view> split_words(std::string_view line, std::string_view separators);

/// Strict and independent of the locale: the whole word is one finite number ("+" allowed).
bool parse_number(std::string_view word, double* value);

}  // namespace uniphy
