#pragma once

#include "uniphy/config/config.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {

/// Declares and reads the sections `model` and `training`; the defaults of their keys are what
/// `defaults` holds. Without `with_steps` the number of steps is not a key.
TrainingOptions read_training_options(Section& config, const TrainingOptions& defaults,
                                      bool with_steps);

}  // namespace uniphy
