#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ops/kernels/learned_law_weights.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// What the isotropic form sees of a sample, and what it must answer: all of it in the frame U of
/// the projected F, where an isotropic law is diagonal but for the rate of deformation.
struct IsotropicColumns {
  enum Column {
    trace = 0,            ///< tr ε of the trial F
    deviator = 1,         ///< ε̂ of the trial F, 3
    norm_decrease = 4,    ///< of ‖ε̂‖ by the projection
    projected_trace = 5,  ///< tr ε of the projected F
    norm_yields = 6,   ///< 1 where the law cuts ‖ε̂‖ back to something, 2 where to 0, else 0
    trace_yields = 7,  ///< 1 where the law cuts tr ε back, else 0
    projected_deviator = 8,  ///< ε̂ of the projected F, 3
    rate = 11,               ///< Uᵀ sym(C) U t₀: 00, 11, 22, 01, 02, 12
    stress = 17,             ///< Uᵀ τ U in Pa, the same order
    trace_decrease = 23,     ///< of tr ε by the projection
    count = 24
  };
};

/// What the seed form sees: its input features, Δ = F_proj − F, and Rᵀ τ R.
struct SeedColumns {
  enum Column {
    projection_in = 0,  ///< F, U, Σ, Vᵀ: 30
    stress_in = 30,  ///< Σ, FᵀF, J, log J, F_max, log F_max, RᵀCR t₀ of the projected F: 25
    delta = 55,      ///< 9
    stress = 64,     ///< Rᵀ τ R in Pa, 9
    count = 73
  };
};

/// The scales that a trajectory's errors are measured by.
struct TrajectoryScale {
  double stress = 0;    ///< RMS of ‖τ‖, Pa
  double strain = 0;    ///< RMS of ‖ε‖ of the projected F
  double decrease = 0;  ///< RMS of the strain that the projection takes; 0 where it takes none
};

struct LawColumns {
  std::int64_t columns = 0;
  std::vector<float> values;            ///< [S, columns]
  std::vector<TrajectoryScale> scales;  ///< [N]
};

/// The columns of a form for every sample, in float64 arithmetic, stored as float32.
LawColumns law_columns(const Dataset& data, kernels::LawForm form);

}  // namespace uniphy
