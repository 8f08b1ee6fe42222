#pragma once

#include <string>

namespace uniphy {

/// JSON for a <script> element: no < of it can end the element or begin a comment.
std::string script_json(std::string json);

/// JavaScript for a <script> element; `</script` in a string of it does not end the element.
std::string script_text(std::string text);

/// HTML of the tables and paragraphs of a text in Markdown; <pre> of a text without a table.
std::string html_of_markdown(const std::string& text);

}  // namespace uniphy
