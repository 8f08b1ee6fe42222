#pragma once

#include <string>

namespace uniphy {

/// Text for XML or HTML, between tags and in quoted attributes.
std::string markup_escaped(const std::string& text);

}  // namespace uniphy
