#pragma once

#include "ops/base/torch.hpp"
#include "ops/kernels/mpm/grid.hpp"

namespace uniphy::ops {

/// The settings of a grid op, kept in its autograd context for the backward pass.
struct SavedGrid : torch::CustomClassHolder {
  explicit SavedGrid(const kernels::GridSettings& s) : settings(s) {}
  kernels::GridSettings settings;
};

inline void save_grid(torch::autograd::AutogradContext* ctx,
                      const kernels::GridSettings& settings) {
  ctx->saved_data["grid"] = torch::IValue::make_capsule(c10::make_intrusive<SavedGrid>(settings));
}

inline kernels::GridSettings saved_grid(torch::autograd::AutogradContext* ctx) {
  return c10::static_intrusive_pointer_cast<SavedGrid>(ctx->saved_data["grid"].toCapsule())
      ->settings;
}

}  // namespace uniphy::ops
