#pragma once

#include "ops/kernels/laws/law.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// What a law costs in a roll-out: ns for one particle in one step (projection and stress, float64)
/// on one core, over states of the data set handed over in the chunks that a simulation uses; CPU
/// time of the thread, the best of many short repetitions, since a busy machine only ever adds to
/// it.
double law_cost(const kernels::LawDescription& law, const Dataset& states);

}  // namespace uniphy
