#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// One finished trajectory of a data set in the making, kept in a file of its own until all are
/// there, so that an interrupted generation goes on where it stopped.
struct TrajectoryPart {
  std::int64_t attempt = 0;           ///< the one that succeeded
  std::vector<std::string> failures;  ///< why those before it were left out
  LawSamples samples;
};

/// `<directory>/<trajectory>.h5`
std::filesystem::path part_path(const std::filesystem::path& directory, std::int64_t trajectory);

/// Written under a temporary name first and sealed (seal.hpp): a part is whole or not there.
void write_part(const std::filesystem::path& file, const TrajectoryPart& part);
/// Nothing where there is no such file. Throws Error for a file that is no part, is damaged, or
/// holds numbers that are not finite.
std::optional<TrajectoryPart> read_part(const std::filesystem::path& file);

}  // namespace uniphy
