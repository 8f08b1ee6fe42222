#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "uniphy/config/config.hpp"
#include "uniphy/inference/fit.hpp"
#include "uniphy/inference/resolution.hpp"

namespace uniphy {

/// Declares and reads the keys of a fit: schedule, optimizer, precision, prior, velocity.
FitOptions read_fit_options(Section& config);

/// What is observed, and how finely it is simulated.
struct ObservationSource {
  std::filesystem::path file;
  Resolution resolution;
  double noise = 0;  ///< m, takes the place of what the file says; 0: nothing does
  std::string cloud_distance = "transport";  ///< Observation::cloud_distance
  int start_degree = -1;  ///< Observation::start_degree in place of the file's; −1: that

  /// Reads the file and fills the bodies where they have to be; adds what was mended in a surface
  /// to `warnings`. Throws Error that names the file.
  std::vector<ObservedBody> load(std::vector<std::string>& warnings) const;
};

/// Declares and reads the keys observation, noise, cloud_distance, start_degree and resolution.
ObservationSource read_observation_source(Section& config);

/// What is fitted: the latent code of a model, or the parameters of an analytic law.
struct FitVariablesSource {
  kernels::LawId id = kernels::LawId::learned;
  std::filesystem::path model;                ///< learned
  std::vector<std::array<double, 2>> ranges;  ///< analytic, in the order of law_parameters(id)
  int starts = 0;
  std::uint64_t seed = 0;

  /// Opens the model. Throws Error that names it.
  std::unique_ptr<const FitVariables> load() const;
};

/// Declares and reads the section `law`.
FitVariablesSource read_fit_variables(Section& config);

}  // namespace uniphy
