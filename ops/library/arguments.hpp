#pragma once

#include <torch/types.h>

#include <string>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"
#include "ops/laws/material.hpp"
#include "ops/learned/learned_networks.hpp"

// What comes from Python as text, numbers and lists, as the types of C++. `op` opens the messages
// of Errors.

namespace uniphy::ops {

/// The keywords of the grid in a schema; the defaults are those of kernels::GridSettings.
inline constexpr const char* kGridArguments =
    "int n=20, float dt=0.0005, float[3] gravity=[0.0, -9.8, 0.0], str walls=\"freeslip\", "
    "int bound=3";
kernels::GridSettings grid_settings(const char* op, std::int64_t n, double dt,
                                    at::ArrayRef<double> gravity, const std::string& walls,
                                    std::int64_t bound);

/// An analytic law by its name; the name "learned" is an error.
kernels::LawId analytic_law(const char* op, const std::string& name);

/// The keywords of the networks in a schema.
inline constexpr const char* kNetworkArguments =
    "str form, str activation, int[] projection_widths, Tensor projection, int[] stress_widths, "
    "Tensor stress";
LearnedNetworks learned_networks(const char* op, const std::string& form,
                                 const std::string& activation, at::IntArrayRef projection_widths,
                                 const torch::Tensor& projection, at::IntArrayRef stress_widths,
                                 const torch::Tensor& stress, std::int64_t latent_size);

}  // namespace uniphy::ops
