#include "ops/base/tensor_check.hpp"

#include <sstream>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy::ops {

using torch::Tensor;

std::string describe(const Tensor& t) {
  if (!t.defined()) return "an undefined tensor";
  std::ostringstream s;
  s << t.sizes() << " " << t.scalar_type() << " on " << t.device();
  return s.str();
}

void refuse(const char* op, const char* name, const std::string& expected, const Tensor& found) {
  throw Error(std::string(op) + ": " + name + ": expected " + expected + ", found " +
              describe(found));
}

void check_tensor(const char* op, const char* name, const Tensor& t, torch::ScalarType dtype,
                  const std::vector<std::int64_t>& sizes) {
  bool fits = t.defined() && t.device().is_cpu() && t.scalar_type() == dtype &&
              t.dim() == static_cast<std::int64_t>(sizes.size());
  for (std::size_t i = 0; fits && i < sizes.size(); ++i) {
    fits = sizes[i] == kAnySize || t.size(static_cast<std::int64_t>(i)) == sizes[i];
  }
  if (fits) return;
  std::ostringstream s;
  s << "[";
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (i > 0) s << ", ";
    if (sizes[i] == kAnySize) {
      s << "any";
    } else {
      s << sizes[i];
    }
  }
  s << "] " << dtype << " on cpu";
  refuse(op, name, s.str(), t);
}

Tensor checked(const char* op, const char* name, const Tensor& t, torch::ScalarType dtype,
               const std::vector<std::int64_t>& sizes) {
  check_tensor(op, name, t, dtype, sizes);
  return t.contiguous();
}

torch::ScalarType real_type(const char* op, const char* name, const Tensor& t) {
  if (t.defined() && (t.scalar_type() == torch::kFloat32 || t.scalar_type() == torch::kFloat64)) {
    return t.scalar_type();
  }
  refuse(op, name, "a Float or Double tensor", t);
}

}  // namespace uniphy::ops
