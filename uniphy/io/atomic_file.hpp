#pragma once

#include <filesystem>
#include <string>

namespace uniphy {

/// Where a file is written before it gets its name: `<file>.tmp` beside it.
std::filesystem::path temporary_name(const std::filesystem::path& file);

/// Flushes the temporary file to the disk and renames it to `file`, so that a reader (or a crash)
/// sees the old content or the new, never a part. Throws Error.
void replace_atomically(const std::filesystem::path& temporary, const std::filesystem::path& file);

/// Writes a whole text file atomically. Throws Error.
void write_text_file(const std::filesystem::path& file, const std::string& text);

/// Reads a whole text file of at most `maximum_bytes`. Throws Error for a missing or unreadable
/// file, a directory, or a longer file.
std::string read_text_file(const std::filesystem::path& file,
                           std::size_t maximum_bytes = std::size_t{1} << 26);

/// Makes the directory and its parents. Throws Error where it cannot, or where a file is in the
/// way.
void make_directory(const std::filesystem::path& directory);

}  // namespace uniphy
