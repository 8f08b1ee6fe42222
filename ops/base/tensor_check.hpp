#pragma once

#include <torch/types.h>

#include <string>
#include <vector>

namespace uniphy::ops {

/// Sizes, dtype and device, for messages.
std::string describe(const torch::Tensor& t);

/// Throws Error: the op, the argument, what was expected, and `found`.
[[noreturn]] void refuse(const char* op, const char* name, const std::string& expected,
                         const torch::Tensor& found);

/// A size that may be anything.
inline constexpr std::int64_t kAnySize = -1;

/// Throws Error naming the op, the argument, what was expected and what was found, unless t is
/// defined, on the CPU, of dtype `dtype` and of the given sizes.
void check_tensor(const char* op, const char* name, const torch::Tensor& t, torch::ScalarType dtype,
                  const std::vector<std::int64_t>& sizes);
/// The tensor, contiguous, after check_tensor.
torch::Tensor checked(const char* op, const char* name, const torch::Tensor& t,
                      torch::ScalarType dtype, const std::vector<std::int64_t>& sizes);

/// The dtype of t; Throws Error unless it is float32 or float64.
torch::ScalarType real_type(const char* op, const char* name, const torch::Tensor& t);

/// A gradient as the kernels take it: contiguous, null where undefined. The tensor is kept in
/// `keep`.
template <class T>
const T* gradient_data(torch::Tensor& keep) {
  if (!keep.defined()) return nullptr;
  keep = keep.contiguous();
  return keep.data_ptr<T>();
}

/// calls f(T()) with T = double or float.
template <class F>
void for_real_type(torch::ScalarType type, const F& f) {
  if (type == torch::kFloat64) {
    f(double());
  } else {
    f(float());
  }
}

}  // namespace uniphy::ops
