#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "uniphy/inference/adaptation_options.hpp"
#include "uniphy/inference/infer_options.hpp"
#include "uniphy/scene/law_config.hpp"

namespace uniphy {

/// A law that moves the bodies of every scene.
struct OutsideTruth {
  std::string name;
  LawSource law;
};
/// A motion that was observed elsewhere.
struct ObservedMotion {
  std::string name;
  std::filesystem::path file;
  std::string truth;  ///< the family that made it, which is not a wrong one; or "none"
};

/// Keys of `kind: outside`.
struct OutsideOptions {
  bool quick = false;
  std::uint64_t seed = 1;  ///< of the drawn objects
  FitVariablesSource learned;
  std::vector<OutsideTruth> laws;
  std::vector<ObservedMotion> observations;
  std::int64_t steps = 1000;
  std::int64_t objects = 4;      ///< drawn, beside the cube
  std::int64_t particles = 500;  ///< about so many in a drawn object
  std::int64_t per_side = 10;    ///< of the cube
  double dt = 5e-4;              ///< s
  bool analytic = true;          ///< fits the wrong analytic laws too
  int starts = 100;              ///< of an analytic law
  FitOptions fit;
  AdaptationOptions adaptation;  ///< of the learned law
};

OutsideOptions read_outside_options(Section& config);

/// Declares and reads the section `scene`; `quick` is known already.
void read_outside_scenes(Section& config, OutsideOptions& options);

/// The laws that a configuration without `laws` has: those of `quick` alone, or all.
std::vector<OutsideTruth> default_outside_laws(bool quick);

}  // namespace uniphy
