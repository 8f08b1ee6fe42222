#pragma once

#include "uniphy/bench/bench_report.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy::bench {

/// What one core reaches against its limits: the roofs of multiply-adds and of copy bandwidth, and
/// every row with counted flops and bytes at its arithmetic intensity.
Chart roofline(const BenchReport& report);

}  // namespace uniphy::bench
