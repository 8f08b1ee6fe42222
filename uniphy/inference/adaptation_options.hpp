#pragma once

#include "uniphy/config/config.hpp"
#include "uniphy/inference/adaptation.hpp"

namespace uniphy {

/// Declares and reads the section `adaptation`.
AdaptationOptions read_adaptation_options(Section& config);

}  // namespace uniphy
