#include "uniphy/evaluation/finished_fits.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/inference/adaptation_state.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

/// The lines of one section of a resolved configuration.
std::string section_text(const std::string& yaml, const std::string& key) {
  const std::size_t begin = yaml.find("\n" + key + ":");
  if (begin == std::string::npos) return {};
  std::size_t end = yaml.find('\n', begin + 1);
  while (end != std::string::npos && end + 1 < yaml.size() && yaml[end + 1] == ' ')
    end = yaml.find('\n', end + 1);
  return yaml.substr(begin + 1, end - begin - 1);
}

std::filesystem::path with_ending(std::filesystem::path stem, const char* ending) {
  return stem += ending;
}

}  // namespace

FinishedFits::FinishedFits(const RunDirectory& out)
    : folder_(out.file("fits")),
      settings_(section_text(out.config_yaml(), "fit") +
                section_text(out.config_yaml(), "adaptation")) {
  make_directory(folder_);
}

std::filesystem::path FinishedFits::stem(const std::string& name, const Observation& seen,
                                         const FitVariables& variables) const {
  return folder_ / fmt::format("{}-{}", name, fit_fingerprint(seen, variables, settings_));
}

FitHooks FinishedFits::hooks(const std::filesystem::path& stem) {
  FitHooks hooks;
  hooks.state_file = with_ending(stem, ".state.h5");
  hooks.fingerprint = stem.filename().string();
  return hooks;
}

void FinishedFits::write(const std::filesystem::path& stem, const Forecast& result,
                         double seconds) {
  Metrics m;
  m.set("fit", result.fit);
  m.set("forecast", result.forecast);
  m.set("rung", result.rung);
  m.set("explained", result.explained ? 1 : 0);
  m.set("nearest", result.nearest);
  m.set("roll_outs", result.roll_outs);
  m.set("seconds", seconds);
  if (!result.material.empty()) m.set("material." + result.material, 1);
  write(stem, m);
}

void FinishedFits::write(const std::filesystem::path& stem, const Metrics& result) {
  result.write(with_ending(stem, ".json"));
  const std::filesystem::path state = hooks(stem).state_file;
  std::error_code ignored;
  std::filesystem::remove(state, ignored);
  std::filesystem::remove(adaptation_state_file(state), ignored);
}

std::optional<Metrics> FinishedFits::read(const std::filesystem::path& stem) {
  const std::filesystem::path file = with_ending(stem, ".json");
  if (!std::filesystem::exists(file)) return {};
  return Metrics::read(file);
}

bool FinishedFits::read(const std::filesystem::path& stem, Forecast& result, double& seconds) {
  const std::optional<Metrics> m = read(stem);
  if (!m) return false;
  const std::filesystem::path file = with_ending(stem, ".json");
  const auto number = [&](const char* name) {
    const auto value = m->find(name);
    if (!value) throw Error(fmt::format("{}: {}: missing", file.string(), name));
    // JSON has no infinity.
    return std::isnan(*value) ? std::numeric_limits<double>::infinity() : *value;
  };
  result.fit = number("fit");
  result.forecast = number("forecast");
  result.rung = static_cast<int>(number("rung"));
  result.explained = number("explained") != 0;
  result.nearest = static_cast<int>(number("nearest"));
  result.roll_outs = number("roll_outs");
  seconds = number("seconds");
  for (const MaterialRanges& family : default_material_ranges()) {
    if (m->find("material." + family.name())) result.material = family.name();
  }
  return true;
}

}  // namespace uniphy
