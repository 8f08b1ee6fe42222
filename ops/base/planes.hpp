#pragma once

#include <torch/types.h>

namespace uniphy::ops {

// The ops of training exchange [N, m, f], m samples of f numbers each for N codes. The kernels take
// them in planes: all m of the first number, then all of the second. Tensors that ops make have
// their memory in this order, whatever their shape says, so that none is transposed on the way.

inline torch::Tensor empty_planes(torch::IntArrayRef sizes, const torch::TensorOptions& options) {
  const std::int64_t m = sizes[1], f = sizes[2];
  return torch::empty_strided(sizes, {m * f, 1, m}, options);
}
/// The same numbers in this order; t itself if it has it.
inline torch::Tensor in_planes(const torch::Tensor& t) {
  return t.transpose(1, 2).contiguous().transpose(1, 2);
}

}  // namespace uniphy::ops
