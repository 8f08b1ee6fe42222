#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ops/kernels/laws/law_memory.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/simd/view.hpp"

namespace uniphy::kernels {

/// Particles are handed to a law in chunks of at most this many, whatever the thread count, so that
/// every sum over particles has one order.
inline constexpr std::ptrdiff_t kLawChunk = 64;

/// A constitutive law: the projection G of the trial deformation gradient and the Kirchhoff stress
/// τ of the projected one. Simulation, inference and export see nothing else. What it remembers of
/// a particle, if anything, is handed in and out; itself it is stateless and safe to call from
/// several threads.
template <class T>
class LawKernel {
 public:
  virtual ~LawKernel() = default;

  /// Numbers that the law is conditioned on and can be differentiated by: the material parameters
  /// of an analytic law (in the order of law_parameters(LawId)), the latent z of a learned one.
  virtual std::ptrdiff_t parameter_size() const = 0;
  /// Length of the running sum that adjoint() adds to.
  virtual std::ptrdiff_t accumulator_size() const = 0;
  /// Turns a summed accumulator into dL/d(parameters); `gradient` has parameter_size() numbers.
  virtual void parameter_gradient(const T* accumulator, T* gradient) const = 0;

  /// Weights and biases of the networks of a learned law, which it can be differentiated by as
  /// well: the projection's, then the stress's, each flat (PackedMlpStorage::add_weight_gradient).
  /// 0 of other laws.
  virtual std::ptrdiff_t weight_size() const { return 0; }
  /// Length of the running sum of the weights, a multiple of 16.
  virtual std::ptrdiff_t weight_sums_size() const { return 0; }
  /// Turns both summed sums into dL/d(weights); `gradient` has weight_size() numbers.
  virtual void weight_gradient(const T* accumulator, const T* weight_sums, T* gradient) const;

  /// Whether it keeps one number of memory a particle.
  virtual bool has_memory() const { return false; }

  /// F_trial, C [count, 9] → F_proj, tau [count, 9]; dt in s, C in 1/s, tau in Pa. F_proj may be
  /// the same memory as F_trial.
  virtual void evaluate(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C,
                        View<T> F_proj, View<T> tau, const LawMemory<T>& memory = {}) const = 0;

  /// The adjoint of evaluate: given dL/dF_proj and dL/dtau, overwrites grad_F_trial, adds to
  /// grad_C, to accumulator and to weight_sums (all three may be null; weight_sums aligned to 64
  /// bytes). grad_F_trial may be the same memory as grad_F_proj.
  virtual void adjoint(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C,
                       View<const T> grad_F_proj, View<const T> grad_tau, View<T> grad_F_trial,
                       View<T> grad_C, T* accumulator, T* weight_sums = nullptr,
                       const LawMemoryAdjoint<T>& memory = {}) const = 0;
};

enum class LawId {
  elastic,                ///< neo-Hookean
  newtonian,              ///< weakly compressible viscous fluid
  plasticine,             ///< von Mises return mapping, StVK-Hencky stress
  sand,                   ///< Drucker–Prager return mapping, StVK-Hencky stress
  non_newtonian,          ///< viscoplastic return mapping, StVK-Hencky stress
  fixed_corotated,        ///< τ = 2μ(F−R)Fᵀ + λJ(J−1)I
  water,                  ///< inviscid: τ = λJ(J−1)I, G(F) = J^{1/3} I
  volume_corrected_sand,  ///< sand that closes up again after a separation; has memory
  mooney_rivlin,          ///< rubber-like solid
  carreau,                ///< fluid that thins or thickens with the rate of shear
  cohesive_sand,          ///< sand that bears some tension
  herschel_bulkley,       ///< viscoplastic with a power of the excess, StVK-Hencky stress
  learned                 ///< a trained model with a latent code
};

/// Whether an analytic law keeps a number of memory a particle (LawKernel::has_memory).
constexpr bool law_has_memory(LawId id) { return id == LawId::volume_corrected_sand; }

/// Everything that names one material. Parameters that the law does not have stay 0.
struct LawDescription {
  LawId id = LawId::elastic;
  double mu = 0;                                     ///< Pa (Pa s for newtonian)
  double lambda = 0;                                 ///< Pa
  double tau_y = 0;                                  ///< Pa
  double theta = 0;                                  ///< friction angle, rad
  double eta = 0;                                    ///< Pa s
  double c1 = 0, c2 = 0;                             ///< Pa
  double eta_inf = 0;                                ///< Pa s
  double kappa = 0;                                  ///< s
  double n = 0;                                      ///< flow index
  double cohesion = 0;                               ///< strain
  std::shared_ptr<const LearnedLawWeights> weights;  ///< learned only
  std::vector<double> z;                             ///< learned only, latent_size numbers
};

/// The name of a law in YAML and HDF5 ("elastic", ...). law_id throws Error listing the known
/// names.
const char* law_name(LawId id);
LawId law_id(const std::string& name);

/// The kernel of a law on the best instruction set of this CPU. Throws Error naming the parameter
/// where one is missing, not finite or not positive, or where z has the wrong length.
template <class T>
std::shared_ptr<const LawKernel<T>> make_law(const LawDescription& description);

}  // namespace uniphy::kernels
