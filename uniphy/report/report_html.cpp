#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/markup.hpp"
#include "uniphy/report/report.hpp"
#include "uniphy/report/report_page.hpp"
#include "uniphy/report/report_payload.hpp"
#include "uniphy/report/report_text.hpp"

namespace uniphy {
namespace {

using Json = nlohmann::ordered_json;
using Places = std::vector<std::pair<std::string, std::string>>;

/// The template with {{name}} replaced by its text; what is put in is not looked at again.
std::string filled(const std::string& pattern, const Places& places) {
  std::string out;
  std::size_t from = 0;
  for (std::size_t at; (at = pattern.find("{{", from)) != std::string::npos;) {
    const std::size_t end = pattern.find("}}", at);
    const std::string name = pattern.substr(at + 2, end - at - 2);
    out.append(pattern, from, at - from);
    for (const auto& [place, text] : places) {
      if (place == name) out += text;
    }
    from = end + 2;
  }
  return out.append(pattern, from, std::string::npos);
}

Json series_json(const Series& series) {
  // NaN and infinities become null.
  Json json{{"label", series.label}, {"points", series.points}, {"x", series.x}, {"y", series.y}};
  if (!series.colour.empty()) json["colour"] = series.colour;
  if (!series.names.empty()) json["names"] = series.names;
  return json;
}

std::string charts_json(const std::vector<Chart>& charts) {
  Json all = Json::array();
  for (const Chart& chart : charts) {
    Json json{{"title", chart.title},    {"xLabel", chart.x_label},
              {"yLabel", chart.y_label}, {"colourLabel", chart.colour_label},
              {"logX", chart.log_x},     {"logY", chart.log_y},
              {"series", Json::array()}};
    for (const Series& series : chart.series) json["series"].push_back(series_json(series));
    all.push_back(std::move(json));
  }
  return script_json(all.dump(-1, ' ', false, Json::error_handler_t::replace));
}

std::string section(const std::string& id, const std::string& title, const std::string& html) {
  return fmt::format("<section id=\"{}\">\n<h2>{}</h2>\n{}</section>\n", id, markup_escaped(title),
                     html);
}

/// A section that can be closed.
std::string details(const std::string& id, const std::string& title, bool open,
                    const std::string& html) {
  return fmt::format(
      "<section id=\"{}\"><details{}>\n<summary><h2>{}</h2></summary>\n{}</details>"
      "</section>\n",
      id, open ? " open" : "", markup_escaped(title), html);
}

std::string tables_html(const Report& report) {
  std::string html;
  for (const ReportTable& table : report.tables) {
    html += section("", table.title, html_of_markdown(table.text));
  }
  return html;
}

std::string metrics_html(const Metrics& metrics, bool open) {
  if (metrics.entries().empty()) return "";
  std::string html = "<div class=\"wide\"><table>\n";
  for (const auto& [name, value] : metrics.entries()) {
    html += fmt::format("<tr><td>{}</td><td class=\"number\">{}</td></tr>\n", markup_escaped(name),
                        std::isfinite(value) ? fmt::format("{:.6g}", value) : "–");
  }
  return details("metrics", "Metrics", open, html + "</table></div>\n");
}

/// The parts of the page that do not depend on how finely the motions are written.
Places places_of(const Report& report, const ReportRun& run) {
  return {{"name", markup_escaped(run.name)},
          {"summary", markup_escaped(run.summary)},
          {"source", markup_escaped(run.source)},
          {"failure", run.failure.empty()
                          ? ""
                          : fmt::format("<p class=\"failure\" role=\"alert\">The run ended before "
                                        "its time: {}</p>\n",
                                        markup_escaped(run.failure))},
          {"style", page::style},
          {"tables", tables_html(report)},
          {"player", report.playbacks.empty() ? "" : section("player", "Motions", "")},
          {"charts", report.charts.empty() ? "" : section("charts", "Charts", "")},
          {"metrics", metrics_html(run.metrics, report.empty())},
          {"config", details("config", "Configuration", false,
                             "<pre class=\"wide\">" + markup_escaped(run.config) + "</pre>\n")},
          {"charts-json", charts_json(report.charts)},
          {"script", script_text(page::script)}};
}

}  // namespace

void Report::set_table(const std::string& title, const std::string& text) {
  for (ReportTable& table : tables) {
    if (table.title != title) continue;
    table.text = text;
    return;
  }
  tables.push_back({title, text});
}

std::string report_html(const Report& report, const ReportRun& run, const std::string& three_js,
                        std::size_t maximum_bytes) {
  Places places = places_of(report, run);
  if (!report.playbacks.empty()) {
    places.emplace_back("three", "<script>" + script_text(three_js) + "</script>\n");
  }
  const std::size_t rest = filled(page::html, places).size();
  if (rest > maximum_bytes) {
    throw Error(fmt::format("report: expected tables and charts of at most {} bytes, found {}",
                            maximum_bytes, rest));
  }
  const ReportPayload payload = payload_of(report.playbacks, maximum_bytes - rest);
  places.emplace_back("motions-json", payload.json);
  places.emplace_back("blobs", payload.blobs);
  return filled(page::html, places);
}

}  // namespace uniphy
