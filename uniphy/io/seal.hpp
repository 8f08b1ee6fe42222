#pragma once

#include <filesystem>
#include <string>

namespace uniphy {

// Files that a later run goes on from end with a seal: a line with the hash (kernels::Hash) of all
// bytes before it. HDF5 and zip archives are read as without it. A file that lost or changed a
// single bit is refused instead of leading to another result.

/// Adds the seal to a file that is not sealed yet, before it gets its name `file`. Throws Error
/// where it cannot be written.
void seal_file(const std::filesystem::path& temporary, const std::filesystem::path& file);
/// Throws Error where the file has no seal or is not what was sealed.
void check_seal(const std::filesystem::path& file);

/// Writes the bytes with their seal, atomically. Throws Error.
void write_sealed_file(const std::filesystem::path& file, const std::string& bytes);
/// The bytes without their seal. Throws Error as check_seal() does.
std::string read_sealed_file(const std::filesystem::path& file);

}  // namespace uniphy
