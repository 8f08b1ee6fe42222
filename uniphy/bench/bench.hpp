#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy::bench {

/// The frame of the binary uniphy_bench: what it is, and its keys and work.
ExperimentInfo bench_info();
RunFunction declare_bench(Section& config);

}  // namespace uniphy::bench
