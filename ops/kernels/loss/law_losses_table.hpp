#pragma once

#include <cstddef>
#include <cstdint>

#include "ops/kernels/loss/sample_columns.hpp"
#include "ops/kernels/simd/dispatch.hpp"

// What Algorithm 1 minimises, for the isotropic form: the errors of caps and moduli (outputs of the
// two networks, formulas in isotropic_law.hpp) on samples of a trajectory. With r = 1/(1 + v Δt₀/(b̄
// Δt)), R the trajectory's RMS and f the error floor,
//   stress error      ‖τ̂ − τ‖²/(‖τ‖² + (f R_τ)²)
//   projection error  (a² + o²)/(Δq² + Δt²/3 + (f R_Δ)²), Δ the decrease that the law makes of
//                     q = ‖ε̂‖ and t = tr ε (R_Δ of ‖ε‖ itself where a trajectory has none)
// Which cap is right depends on what the law does with the sample; Q = e c₁, T = e c₂ are the caps:
//   a    = x − y(x) − Δq, x = q − Q   the law cuts q back to something; y is what stays of x
//          max(Q, 0) + y(q − max(Q, 0))
//                                     it cuts q to 0: any cap at or below 0 is right
//          max(r, 0.05) (q − Q)₊      it leaves q alone: any cap beyond q is right, the less it
//                                     matters the smaller r, which takes no gradient from it
//   o²   = (Q − q + Δq)₊²             where it cuts to something: whatever the share, a cap is no
//                                     higher than what a sample that yields comes down to; without
//                                     it a share near 0 would hide a cap that is far too high
//        + (0.1 q (c₁ + 1)₊)²         a fluid, whose cap is to lie below kFluidCap with some room
//        + ⅓ (T − t')² or ⅓ (t − T)₊² the trace, cut to t' or left alone; a fluid's cap is to lie
//                                     beyond t + t₊, since the few samples that expand most weigh
//                                     too little to keep it beyond t
// "Whole" is a with y = 0: a law that returns the whole way to the cap.

namespace uniphy::kernels {

/// Samples of one trajectory. All pointers are borrowed.
template <class T>
struct SampleFeatures {
  const T* columns;          ///< [S, SampleColumns::count]
  const std::int64_t* rows;  ///< [count], which of the S
  std::ptrdiff_t count;
  T strain_scale;  ///< e
};

/// What the errors are taken of. All pointers are borrowed.
template <class T>
struct IsotropicAnswers {
  SampleFeatures<T> samples;
  const T* caps;                  ///< [kCapOutputs, count or 1]
  const T* moduli;                ///< [kStressOutputs, count or 1]
  bool state_caps, state_moduli;  ///< whether there is one for each sample
  T rest_cap;                     ///< min(c₂(rest), 0)
  T rest_pressure;                ///< a₀(rest)
  T stress_scale;                 ///< s, Pa
  T flow_time;                    ///< kFlowStep over the time step of the trajectory
  T stress_floor2;                ///< (f R_τ)²
  T strain_floor2;                ///< (f R_Δ)²
  T delta;                        ///< δ of log(1 + error/δ)
};

/// Means over the samples of a trajectory; the last two are for reports and have no gradient.
enum IsotropicMean {
  kStressLoss,      ///< log(1 + stress error/δ)
  kProjectionLoss,  ///< log(1 + projection error/δ)
  kWholeLoss,       ///< the same of the law that returns the whole way
  kShare,           ///< r
  kStressError,
  kProjectionError,
  kIsotropicMeans
};
inline constexpr int kIsotropicLosses = kStressError;

/// Where the adjoint writes. Null pointers are skipped.
template <class T>
struct IsotropicAnswersGradient {
  T* caps;    ///< as IsotropicAnswers::caps
  T* moduli;  ///< as IsotropicAnswers::moduli
  T rest_cap, rest_pressure, log_s, log_e;
};

/// The inner loops on one instruction set.
template <class T>
struct LawLossesTable {
  /// → means [kIsotropicMeans]
  void (*errors)(const IsotropicAnswers<T>&, T* means);
  /// weights [kIsotropicLosses]: dL/d(means).
  void (*errors_adjoint)(const IsotropicAnswers<T>&, const T* weights,
                         IsotropicAnswersGradient<T>& gradient);
  /// What networks that answer to the state see: projection [3, count], stress [6, count].
  void (*features)(const SampleFeatures<T>&, T* projection, T* stress);
  /// dL/d(log e), given those of the features, either of which may be null.
  T (*features_adjoint)(const SampleFeatures<T>&, const T* grad_projection, const T* grad_stress);
};

UNIPHY_ISA_TABLE(LawLossesTable<float>)
UNIPHY_ISA_TABLE(LawLossesTable<double>)

/// The table of an instruction set, the active one by default. Throws Error where it is not
/// available.
template <class T>
const LawLossesTable<T>& law_losses_table(Isa isa = active_isa()) {
  return table_of<LawLossesTable<T>>(isa);
}

}  // namespace uniphy::kernels
