#include "uniphy/report/report_text.hpp"

#include <cctype>
#include <sstream>
#include <vector>

#include "uniphy/io/markup.hpp"

namespace uniphy {
namespace {

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
}

bool is_row(const std::string& line) { return !line.empty() && line.front() == '|'; }

/// The cells between the bars of "| a | b |".
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t from = 1;
  for (std::size_t at; (at = line.find('|', from)) != std::string::npos; from = at + 1) {
    const std::size_t first = line.find_first_not_of(' ', from);
    const std::size_t last = line.find_last_not_of(' ', at - 1);
    cells.push_back(first < at ? line.substr(first, last - first + 1) : "");
  }
  return cells;
}

bool is_rule(const std::string& line) {
  return line.find_first_not_of("|-: ") == std::string::npos;
}

/// Numbers stand on the right.
bool is_number(const std::string& cell) {
  return !cell.empty() && (std::isdigit(static_cast<unsigned char>(cell.front())) ||
                           (cell.size() > 1 && cell.front() == '-' &&
                            std::isdigit(static_cast<unsigned char>(cell[1]))));
}

std::string html_row(const std::string& line, const char* tag) {
  std::string html = "<tr>";
  for (const std::string& cell : cells_of(line)) {
    html += std::string("<") + tag + (is_number(cell) ? " class=\"number\">" : ">") +
            markup_escaped(cell) + "</" + tag + ">";
  }
  return html + "</tr>\n";
}

std::string html_table(const std::vector<std::string>& rows) {
  const bool headed = rows.size() > 1 && is_rule(rows[1]);
  std::string html = "<div class=\"wide\"><table>\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (headed && i == 1) continue;
    html += headed && i == 0 ? "<thead>" + html_row(rows[i], "th") + "</thead>"
                             : html_row(rows[i], "td");
  }
  return html + "</table></div>\n";
}

}  // namespace

std::string script_json(std::string json) {
  replace_all(json, "<", "\\u003c");
  return json;
}

std::string script_text(std::string text) {
  replace_all(text, "</script", "<\\/script");
  replace_all(text, "<!--", "<\\!--");
  return text;
}

std::string html_of_markdown(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> rows;
  std::string html, paragraph;
  bool any = false;
  const auto end_block = [&] {
    if (!rows.empty()) html += html_table(rows);
    if (!paragraph.empty()) html += "<p>" + markup_escaped(paragraph) + "</p>\n";
    any = any || !rows.empty();
    rows.clear();
    paragraph.clear();
  };
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || is_row(line) != !rows.empty()) end_block();
    if (line.empty()) continue;
    if (is_row(line)) {
      rows.push_back(line);
    } else {
      paragraph += (paragraph.empty() ? "" : " ") + line;
    }
  }
  end_block();
  return any ? html : "<pre class=\"wide\">" + markup_escaped(text) + "</pre>\n";
}

}  // namespace uniphy
