#pragma once

#include <filesystem>

#include "uniphy/data/generate_options.hpp"
#include "uniphy/evaluation/law_checks.hpp"
#include "uniphy/training/latent_fit.hpp"

namespace uniphy {

/// What `kind: heldout` of uniphy_evaluate works on.
struct HeldoutOptions {
  GenerateOptions draw;  ///< seed and everything but the split
  std::filesystem::path model;
  LatentFitOptions fit;
  RestOptions rest;
};

}  // namespace uniphy
