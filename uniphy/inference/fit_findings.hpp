#pragma once

#include <array>
#include <string>
#include <vector>

#include "uniphy/inference/infer_run.hpp"

namespace uniphy {

/// A parameter of a fitted analytic law beside the range that its starts were drawn from.
struct FittedParameter {
  std::string name, unit;
  double value = 0;
  std::array<double, 2> range{};

  /// Beyond rounding: values go through a logarithm.
  bool outside() const;
};
/// In the order of law_parameters; none of a learned law.
std::vector<FittedParameter> fitted_parameters(const kernels::LawDescription& law,
                                               const FitVariables& variables);

/// What was found, a line each: the parameters with their ranges, and the nearest starts. Where
/// nothing is determined, that alone.
std::string fit_summary(const FitResult& fit, const FitVariables& variables);

/// What is doubtful about a finished fit, a sentence each:
///   - no wall acted before the last frame, or nothing is determined by what was seen after it;
///   - the first frame is not an undeformed body in rigid motion (start_warning);
///   - less than one particle a cell (sparse_warning);
///   - a misfit of more than kLargeMisfit and the noise;
///   - a motion that is not explained (Inference::explained), when and where;
///   - a parameter outside of its range;
///   - a learned law that flows_by_steps, at another time step than that of its training.
std::vector<std::string> fit_warnings(const Inference& inference, const Observation& observation,
                                      const FitVariables& variables);

/// Misfit over size. The best code of any other material misses the five objects of uniphy_identify
/// by 0.3 to 0.8 %: a fit that misses by more cannot tell one material from another.
inline constexpr double kLargeMisfit = 0.01;

}  // namespace uniphy
