#pragma once

#include <array>

namespace uniphy::stability {

/// A way to compute with a law, and what it stands for in a sentence.
struct Method {
  const char* name;
  const char* text;
  bool reference;  ///< known to fail somewhere; shown beside ours
};

inline constexpr std::array<Method, 9> kMethods{
    {{"analytic", "the analytic laws of the five families, through the kernels and ops", false},
     {"isotropic", "the trained isotropic law with its codes of the five families", false},
     {"exported", "the same law and codes as its TorchScript file, law.pt, in float64", false},
     {"published", "the published form (raw F, U, S, V into a network), randomly initialised: weak",
      false},
     {"raw_svd", "the same analytic laws through U and V of torch::linalg_svd and its derivative",
      true},
     {"clamped_svd",
      "the same, with |s_i^2 - s_j^2| no smaller than 1e-6 in the derivative, as NCLaw and Warp "
      "have it",
      true},
     {"nan_to_zero", "the same as raw_svd, with every NaN and infinity of a gradient set to 0",
      true},
     {"unchecked_step",
      "the analytic laws at a fixed time step, positions clamped to the grid and nothing checked",
      true},
     {"mass_epsilon",
      "the same step as ours, but momentum/(mass + 1e-7 kg) on the grid in place of a mass "
      "threshold",
      true}}};

}  // namespace uniphy::stability
