#pragma once

namespace uniphy::kernels {

/// What the isotropic form sees of a sample, and what it must answer: all of it in the frame U of
/// the projected F, where an isotropic law is diagonal but for the rate of deformation. Strains are
/// Hencky's, ε = log Σ, with the deviator ε̂ = ε − tr(ε)/3.
struct SampleColumns {
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

}  // namespace uniphy::kernels
