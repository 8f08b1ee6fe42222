#include "uniphy/stability/finished_cells.hpp"

#include <fmt/format.h>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy::stability {
namespace {

/// To be raised where a stressor measures something else than before.
constexpr int kVersion = 1;

}  // namespace

FinishedCells::FinishedCells(std::filesystem::path folder) : folder_(std::move(folder)) {
  make_directory(folder_);
}

std::filesystem::path FinishedCells::file(const std::string& stressor, const std::string& method,
                                          const std::string& setting,
                                          const std::string& settings) const {
  kernels::Hash hash;
  hash.add(fmt::format("{}\n{}\n{}\n{}\n{}", kVersion, stressor, method, setting, settings));
  return folder_ / fmt::format("{}-{}-{}.json", stressor, method, hash.text());
}

std::optional<Cell> FinishedCells::find(const std::string& stressor, const std::string& method,
                                        const std::string& setting,
                                        const std::string& settings) const {
  const std::filesystem::path from = file(stressor, method, setting, settings);
  if (!std::filesystem::exists(from)) return {};
  try {
    return cell_from_json(read_text_file(from));
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", from.string(), error.what()));
  }
}

void FinishedCells::keep(const Cell& cell, const std::string& settings) const {
  write_text_file(file(cell.stressor, cell.method, cell.setting, settings), cell_to_json(cell));
}

}  // namespace uniphy::stability
