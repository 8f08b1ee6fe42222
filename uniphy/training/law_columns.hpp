#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/loss/sample_columns.hpp"
#include "uniphy/io/dataset.hpp"

namespace uniphy {

/// What the published form sees: its input features, Δ = F_proj − F, and Rᵀ τ R.
struct PublishedColumns {
  enum Column {
    projection_in = 0,  ///< F, U, Σ, Vᵀ, less what they are at rest: 30
    stress_in = 30,     ///< Σ, FᵀF, J, log J, F_max, log F_max of the projected F, likewise: 16
    rate_in = 46,       ///< RᵀCR t₀: 9
    delta = 55,         ///< 9
    stress = 64,        ///< Rᵀ τ R in Pa, 9
    count = 73
  };
};

/// The scales that a trajectory's errors are measured by, and its time step.
struct TrajectoryScale {
  double stress = 0;     ///< RMS of ‖τ‖, Pa
  double strain = 0;     ///< RMS of ‖ε‖ of the projected F
  double decrease = 0;   ///< RMS of the strain that the projection takes; 0 where it takes none
  double flow_time = 1;  ///< kernels::kFlowStep over the time step
};

/// A data set as the objective sees it.
struct LawColumns {
  kernels::LawForm form = kernels::LawForm::isotropic;
  torch::Tensor values;                 ///< [S, PublishedColumns or SampleColumns::count] float32
  std::vector<TrajectoryScale> scales;  ///< [N]
  std::vector<std::int64_t> first;      ///< [N + 1], as Dataset::first

  std::int64_t trajectories() const { return static_cast<std::int64_t>(scales.size()); }
};

/// The columns of a form, PublishedColumns or kernels::SampleColumns, for every sample, in float64
/// arithmetic. Each F and F_proj is decomposed once: what is made of a data set is to be kept for
/// all that works on it.
LawColumns law_columns(const Dataset& data, kernels::LawForm form);

}  // namespace uniphy
