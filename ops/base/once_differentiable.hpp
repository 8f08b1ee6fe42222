#pragma once

#include <torch/types.h>

namespace uniphy::ops {

/// What a hand-written backward pass returns. It is no graph of tensor operations: a second
/// derivative through it would silently be zero. So where a graph of the gradients is asked for
/// (create_graph), this throws Error.
torch::autograd::variable_list once_differentiable(const char* op,
                                                   torch::autograd::variable_list gradients);

}  // namespace uniphy::ops
