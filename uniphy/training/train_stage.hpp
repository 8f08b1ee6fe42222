#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// Declares the keys of uniphy_train and returns its work.
RunFunction train_stage(Section& config);

}  // namespace uniphy
