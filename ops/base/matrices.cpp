#include "ops/base/matrices.hpp"

#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"

namespace uniphy::ops {

using torch::Tensor;

void check_matrices(const char* op, const char* name, const Tensor& t) {
  if (!t.defined() || !t.device().is_cpu() || t.dim() != 3 || t.size(1) != 3 || t.size(2) != 3 ||
      (t.scalar_type() != torch::kFloat32 && t.scalar_type() != torch::kFloat64))
    refuse(op, name, "[P, 3, 3] Float or Double on cpu", t);
}

void check_like(const char* op, const char* name, const Tensor& t, const Tensor& F) {
  if (t.defined() && t.device().is_cpu() && t.sizes() == F.sizes() &&
      t.scalar_type() == F.scalar_type())
    return;
  refuse(op, name, describe(F), t);
}

}  // namespace uniphy::ops
