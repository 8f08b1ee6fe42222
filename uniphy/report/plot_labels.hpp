#pragma once

#include <string>

#include "uniphy/report/plot.hpp"

namespace uniphy {

/// gnuplot's commands that write the names of a chart's points beside them, where they cover
/// neither a point nor each other by an estimate of where all of it stands; the others are left
/// out.
std::string label_commands(const Chart& chart);

}  // namespace uniphy
