#include "uniphy/stability/stability_cell.hpp"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "ops/kernels/base/error.hpp"

namespace uniphy::stability {

const char* verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::holds:
      return "holds";
    case Verdict::stops:
      return "stops";
    case Verdict::fails:
      break;
  }
  return "fails";
}

void Cell::set(const std::string& name, double value) {
  for (auto& [known, number] : numbers) {
    if (known != name) continue;
    number = value;
    return;
  }
  numbers.emplace_back(name, value);
}

std::optional<double> Cell::find(const std::string& name) const {
  for (const auto& [known, number] : numbers) {
    if (known == name) return number;
  }
  return {};
}

double Cell::decided() const {
  return find(deciding).value_or(std::numeric_limits<double>::quiet_NaN());
}

std::string cell_to_json(const Cell& cell) {
  nlohmann::ordered_json json;
  json["stressor"] = cell.stressor;
  json["method"] = cell.method;
  json["setting"] = cell.setting;
  json["verdict"] = verdict_name(cell.verdict);
  json["deciding"] = cell.deciding;
  json["numbers"] = nlohmann::ordered_json::array();
  for (const auto& [name, value] : cell.numbers) json["numbers"].push_back({name, value});
  json["step"] = cell.failure.step;
  json["particle"] = cell.failure.particle;
  json["cause"] = cell.failure.cause;
  return json.dump(1) + "\n";
}

Cell cell_from_json(const std::string& text) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    Cell cell;
    json.at("stressor").get_to(cell.stressor);
    json.at("method").get_to(cell.method);
    json.at("setting").get_to(cell.setting);
    json.at("deciding").get_to(cell.deciding);
    const auto verdict = json.at("verdict").get<std::string>();
    bool known = false;
    for (const Verdict v : {Verdict::holds, Verdict::stops, Verdict::fails}) {
      if (verdict != verdict_name(v)) continue;
      cell.verdict = v;
      known = true;
    }
    if (!known) throw Error("verdict: expected holds, stops or fails, found " + verdict);
    for (const auto& pair : json.at("numbers")) {
      const auto& value = pair.at(1);
      cell.numbers.emplace_back(
          pair.at(0).get<std::string>(),
          value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>());
    }
    json.at("step").get_to(cell.failure.step);
    json.at("particle").get_to(cell.failure.particle);
    json.at("cause").get_to(cell.failure.cause);
    return cell;
  } catch (const nlohmann::json::exception& error) {
    throw Error(std::string("not a cell: ") + error.what());
  }
}

}  // namespace uniphy::stability
