#pragma once

#include "uniphy/report/experiment.hpp"

namespace uniphy {

/// Declares the keys of uniphy_evaluate and returns its work: `kind: trajectory` compares one
/// trajectory with another (comparison.hpp), `kind: heldout` judges a trained law
/// (heldout_stage.hpp). Keys of the other kind are unknown keys.
RunFunction evaluate_stage(Section& config);

}  // namespace uniphy
