#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// The pieces that a law falls into, where a learned one errs differently. "near" is within 20 %
/// below and 25 % above the yield surface, measured by q/q_y with q the norm of the deviatoric
/// Hencky strain of the trial F and q_y = yield_norm().
///   elastic                    rest, small, compressed (J < 1), stretched
///   newtonian                  rest, compressed, expanded
///   plasticine, non_newtonian  elastic, elastic_near, yield_near, yield
///   sand                       apex (tr ε > 0), elastic, elastic_near, yield_near, yield
/// rest: strain below 1e-4; small: below 1e-2.
const std::vector<std::string>& branch_names(kernels::LawId id);

inline constexpr double kRestStrain = 1e-4;
inline constexpr double kSmallStrain = 1e-2;
inline constexpr double kNearBelow = 0.8;
inline constexpr double kNearAbove = 1.25;

/// Where one sample lies.
struct SampleFeatures {
  int branch = 0;     ///< index into branch_names()
  double strain = 0;  ///< ‖ε‖ of the trial F (newtonian: |log J|)
  double second = 0;  ///< where it yields, how far beyond the surface: ‖ε − ε_proj‖; else ‖C‖, 1/s
};

/// F_trial, F_proj, C: row-major 3×3.
SampleFeatures sample_features(const kernels::LawDescription& law, const double* F_trial,
                               const double* F_proj, const double* C);

/// The features of all samples.
std::vector<SampleFeatures> sample_features(const kernels::LawDescription& law,
                                            const LawSamples& samples);

}  // namespace uniphy
