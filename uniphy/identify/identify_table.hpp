#pragma once

#include <string>
#include <vector>

#include "uniphy/identify/case_result.hpp"
#include "uniphy/inference/material_belief.hpp"

namespace uniphy {

/// The numbers by which its material is known (of an elastic body its moduli, of a plastic one what
/// it yields at, …), in a line.
std::string reading_text(const MaterialReading& reading);
/// The same with 90 % intervals, where they are known.
std::string reading_text(const MaterialBelief& belief);

/// What was identified, in Markdown.
std::string identify_table(const std::vector<Identified>& rows);

}  // namespace uniphy
