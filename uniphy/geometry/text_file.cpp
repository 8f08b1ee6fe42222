#include "uniphy/geometry/text_file.hpp"

#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "ops/kernels/base/error.hpp"

namespace uniphy {

std::string read_text_file(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::is_directory(file, failure)) {
    throw Error(file.string() + ": expected a file, found a folder");
  }
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (!failure && size > (std::uintmax_t{1} << 30)) {
    throw Error(file.string() + ": expected at most 1 GiB, found " + std::to_string(size) +
                " bytes");
  }
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  // An empty file sets failbit on the << although nothing went wrong.
  if (!stream || (size > 0 && !(text << stream.rdbuf()))) {
    throw Error(file.string() + ": cannot be read (does it exist?)");
  }
  return text.str();
}

void for_each_line(const std::string& text,
                   const std::function<void(std::int64_t, std::string_view)>& visit) {
  std::int64_t number = 0;
  for (std::size_t start = 0; start < text.size();) {
    std::size_t end = text.find('\n', start);
    if (end == std::string::npos) end = text.size();
    std::string_view line(text.data() + start, end - start);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    visit(++number, line);
    start = end + 1;
  }
}

std::vector<std::string_view> split_words(std::string_view line, std::string_view separators) {
  std::vector<std::string_view> words;
  std::size_t start = line.find_first_not_of(separators);
  while (start != std::string_view::npos) {
    std::size_t end = line.find_first_of(separators, start);
    if (end == std::string_view::npos) end = line.size();
    words.push_back(line.substr(start, end - start));
    start = line.find_first_not_of(separators, end);
  }
  return words;
}

bool parse_number(std::string_view word, double* value) {
  if (!word.empty() && word[0] == '+') word.remove_prefix(1);
  const auto end = std::from_chars(word.data(), word.data() + word.size(), *value);
  return end.ec == std::errc() && end.ptr == word.data() + word.size() && std::isfinite(*value);
}

}  // namespace uniphy
