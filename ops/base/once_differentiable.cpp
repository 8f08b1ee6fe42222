#include "ops/base/once_differentiable.hpp"

#include <string>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::ops {

torch::autograd::variable_list once_differentiable(const char* op,
                                                   torch::autograd::variable_list gradients) {
  if (torch::GradMode::is_enabled()) {
    throw Error(std::string(op) +
                ": is differentiable once: expected a backward pass without create_graph");
  }
  return gradients;
}

}  // namespace uniphy::ops
