#include "uniphy/evaluation/materials_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "ops/kernels/base/statistics.hpp"

namespace uniphy {
namespace {

/// The numbers that a material is judged by (metrics NAME.CASE).
struct Judged {
  const char *name, *material, *key;
};
constexpr std::array<Judged, 4> kJudged{{{"mu_error", "elastic", "mu"},
                                         {"lambda_error", "elastic", "lambda"},
                                         {"yield_error", "plasticine", "yield_stress"},
                                         {"friction_error", "sand", "friction_angle"}}};

double found_number(const MaterialRow& row, const std::string& key) {
  return row.found.find("reading." + key).value_or(MaterialReading::kNone);
}

double median_or_none(const std::vector<double>& numbers) {
  return numbers.empty() ? MaterialReading::kNone : kernels::median(numbers);
}

/// In the order in which they come.
std::vector<std::string> values_of(const std::vector<MaterialRow>& rows,
                                   const std::string& (*value)(const MaterialRow&)) {
  std::vector<std::string> values;
  for (const MaterialRow& row : rows) {
    if (std::find(values.begin(), values.end(), value(row)) == values.end())
      values.push_back(value(row));
  }
  return values;
}

const std::string& observed_of(const MaterialRow& row) { return row.observed; }
const std::string& material_of(const MaterialRow& row) { return row.truth.material; }

struct Named {
  std::size_t right = 0, total = 0;
};
Named named(const std::vector<MaterialRow>& rows, const std::string& observed,
            const std::string& material) {
  Named n;
  for (const MaterialRow& row : rows) {
    if (row.observed != observed || (!material.empty() && row.truth.material != material)) continue;
    ++n.total;
    n.right += row.material == row.truth.material ? 1 : 0;
  }
  return n;
}

/// "1.2 %, 9/10 in ±3 %".
std::string cell(const NumberErrors& e) {
  if (e.objects == 0) return "n/a";
  if (e.read == 0) return fmt::format("not read, 0/{}", e.objects);
  std::string text = fmt::format("{:.2g} %, {}/{}", 100 * e.error, e.held, e.objects);
  if (std::isfinite(e.width)) text += fmt::format(" in ±{:.2g} %", 50 * e.width);
  return text;
}

}  // namespace

NumberErrors number_errors(const std::vector<MaterialRow>& rows, const std::string& observed,
                           const std::string& material, const std::string& key) {
  const auto& numbers = reading_numbers();
  const auto number = std::find_if(numbers.begin(), numbers.end(),
                                   [&](const ReadingNumber& n) { return key == n.key; });
  NumberErrors e;
  std::vector<double> errors, widths;
  for (const MaterialRow& row : rows) {
    if (row.observed != observed || (!material.empty() && row.truth.material != material)) continue;
    const double truth = row.truth.*number->value;
    if (!(truth > 0)) continue;
    ++e.objects;
    const double found = found_number(row, key);
    if (!std::isfinite(found)) continue;
    ++e.read;
    errors.push_back(std::abs(found / truth - 1));
    const double low = found_number(row, key + ".low"), high = found_number(row, key + ".high");
    if (!std::isfinite(low) || !std::isfinite(high)) continue;
    e.held += low <= truth && truth <= high ? 1 : 0;
    widths.push_back((high - low) / truth);
  }
  e.error = median_or_none(errors);
  e.width = median_or_none(widths);
  return e;
}

std::string materials_table(const std::vector<MaterialRow>& rows) {
  std::vector<const ReadingNumber*> shown;
  for (const ReadingNumber& n : reading_numbers()) {
    const auto has = [&](const MaterialRow& row) { return row.truth.*n.value > 0; };
    if (std::any_of(rows.begin(), rows.end(), has)) shown.push_back(&n);
  }
  std::string text = "| observed | material | named rightly |", line = "|---|---|---|";
  for (const ReadingNumber* n : shown) {
    text += fmt::format(" {} |", n->name);
    line += "---|";
  }
  text += "\n" + line + "\n";
  for (const std::string& observed : values_of(rows, observed_of)) {
    std::vector<std::string> materials = values_of(rows, material_of);
    materials.push_back("");
    for (const std::string& material : materials) {
      const Named n = named(rows, observed, material);
      if (n.total == 0) continue;
      text += fmt::format("| {} | {} | {}/{} |", observed, material.empty() ? "all" : material,
                          n.right, n.total);
      for (const ReadingNumber* number : shown) {
        text += fmt::format(" {} |", cell(number_errors(rows, observed, material, number->key)));
      }
      text += "\n";
    }
  }
  return text +
         "\nMedian error of the numbers that were read; intervals (90 %) that hold the truth of "
         "all "
         "objects that have such a number, and the half of their median width. A body is what its "
         "law does at the strains that it reached: one that never yielded is elastic.\n";
}

std::string materials_csv(const std::vector<MaterialRow>& rows) {
  std::string text = "observed,object,material,named,probability,number,truth,found,low,high\n";
  for (const MaterialRow& row : rows) {
    const double probability =
        row.found.find("probability." + row.truth.material).value_or(MaterialReading::kNone);
    for (const ReadingNumber& n : reading_numbers()) {
      const std::string key = n.key;
      const double truth = row.truth.*n.value, found = found_number(row, key);
      if (!std::isfinite(truth) && !std::isfinite(found)) continue;
      text += fmt::format("{},{},{},{},{:.4g},{},{:.6g},{:.6g},{:.6g},{:.6g}\n", row.observed,
                          row.object, row.truth.material, row.material, probability, key, truth,
                          found, found_number(row, key + ".low"), found_number(row, key + ".high"));
    }
  }
  return text;
}

void add_materials_metrics(const std::vector<MaterialRow>& rows, Metrics& metrics) {
  for (const std::string& observed : values_of(rows, observed_of)) {
    const auto set = [&](const std::string& name, double value) {
      if (std::isfinite(value)) metrics.set(name, value);
    };
    const auto set_named = [&](const std::string& suffix, const std::string& material) {
      const Named n = named(rows, observed, material);
      if (n.total == 0) return;
      metrics.set("class_right." + suffix, static_cast<double>(n.right));
      metrics.set("class_total." + suffix, static_cast<double>(n.total));
    };
    set_named(observed, "");
    std::size_t objects = 0, held = 0;
    for (const Judged& j : kJudged) {
      const NumberErrors e = number_errors(rows, observed, j.material, j.key);
      set(fmt::format("{}.{}", j.name, observed), e.error);
      objects += e.objects;
      held += e.held;
    }
    if (objects > 0)
      metrics.set("coverage." + observed, static_cast<double>(held) / static_cast<double>(objects));
    metrics.set("intervals." + observed, static_cast<double>(objects));
    for (const std::string& material : values_of(rows, material_of)) {
      set_named(fmt::format("{}.{}", observed, material), material);
      for (const ReadingNumber& n : reading_numbers()) {
        const NumberErrors e = number_errors(rows, observed, material, n.key);
        if (e.objects == 0) continue;
        const std::string suffix = fmt::format("{}.{}.{}", n.key, observed, material);
        set("error." + suffix, e.error);
        set("coverage." + suffix, static_cast<double>(e.held) / static_cast<double>(e.objects));
      }
    }
  }
}

}  // namespace uniphy
