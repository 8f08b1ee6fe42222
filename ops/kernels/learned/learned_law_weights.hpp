#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ops/kernels/spectral/limits.hpp"

namespace uniphy::kernels {

/// Smooth activations. gelu is the exact one, x Φ(x); silu is x / (1 + exp(-x)); squareplus is
/// (x + sqrt(x² + 4)) / 2 − 1, the cheapest (one square root).
enum class Activation { gelu, silu, squareplus };

const char* activation_name(Activation activation);
/// Throws Error that lists the known names.
Activation activation_from_name(const std::string& name);

/// A multilayer perceptron: every layer but the last is followed by the activation.
struct MlpWeights {
  struct Layer {
    int in = 0;
    int out = 0;
    std::vector<double> weight;  ///< [out, in], row-major
    std::vector<double> bias;    ///< [out]
  };
  std::vector<Layer> layers;
};

enum class LawForm {
  isotropic,  ///< invariants, a yield gate, a tensor basis
  published   ///< raw F, U, Σ, Vᵀ; the published network
};

const char* form_name(LawForm form);
LawForm form_from_name(const std::string& name);

/// What the two networks of the isotropic form answer with (formulas: isotropic_law.hpp), in the
/// order of their outputs.
enum CapOutput {
  kCap,           ///< c₀
  kTraceCap,      ///< c₂
  kCapSlope,      ///< m
  kCapViscosity,  ///< η̃
  kFlowExponent,  ///< p̃
  kCapOutputs
};
enum StressOutput {
  kBulk,            ///< k̃
  kPressure,        ///< a₀
  kShear,           ///< ã₁
  kSecondShear,     ///< ã₂
  kViscosity,       ///< b̃
  kShearExponent,   ///< n₁
  kVolumeGamma,     ///< γ
  kVolumeDelta,     ///< δ
  kSecondExponent,  ///< n₂
  kIsochoricShare,  ///< ω
  kRateViscosity,   ///< b̃₁
  kRateScale,       ///< κ̃
  kRateExponent,    ///< ν
  kBulkRateShare,   ///< β
  kStressOutputs
};

/// The numbers of features, before z, that enter the two networks, and of their outputs.
struct NetworkShape {
  int projection_in, projection_out, stress_in, stress_out;
};
constexpr NetworkShape network_shape(LawForm form) {
  return form == LawForm::isotropic ? NetworkShape{3, kCapOutputs, 6, kStressOutputs}
                                    : NetworkShape{30, 9, 25, 9};
}

template <class T>
struct PackedNetworks;

/// Where weights keep their packed form, one for each precision, made when a law first asks for it.
/// A copy of the weights may be changed, so it packs its own.
class PackedNetworksCache {
 public:
  PackedNetworksCache() = default;
  PackedNetworksCache(const PackedNetworksCache&) {}
  PackedNetworksCache& operator=(const PackedNetworksCache&);

 private:
  friend struct LearnedLawWeights;
  std::mutex mutex_;
  std::shared_ptr<const PackedNetworks<float>> narrow_;
  std::shared_ptr<const PackedNetworks<double>> wide_;
};

/// The learned law without torch: what a model file holds. The first layers take the features of
/// network_shape first, then z.
struct LearnedLawWeights {
  LawForm form = LawForm::isotropic;
  int latent_size = 0;
  Activation activation = Activation::gelu;
  MlpWeights projection;
  MlpWeights stress;

  /// Throws Error naming the first layer whose shape does not fit.
  void check() const;

  /// The networks as the kernels read them (packed_networks.hpp), packed in the first call and
  /// shared by the laws of all z. Weights that a law was made of must not change
  /// any more; their copies may. Safe to call from several threads. Throws Error where check()
  /// does.
  template <class T>
  std::shared_ptr<const PackedNetworks<T>> packed() const;
  mutable PackedNetworksCache packed_networks = {};
};

template <>
std::shared_ptr<const PackedNetworks<float>> LearnedLawWeights::packed() const;
template <>
std::shared_ptr<const PackedNetworks<double>> LearnedLawWeights::packed() const;

/// Whether the first `features` inputs of a network, those before z, have no weight.
bool ignores_state(const MlpWeights& network, int features);

/// The same law with G(F) = F to the bit (caps out of reach, or no change), or without its stress
/// network: the way to ask a law for its stress or its projection alone.
std::shared_ptr<const LearnedLawWeights> without_projection(const LearnedLawWeights& weights);
std::shared_ptr<const LearnedLawWeights> without_stress(const LearnedLawWeights& weights);

// The units that the networks see; spec of the isotropic form. Coordinates 0 and 1 of z carry a
// stress scale and a strain scale, so that one network serves soft and stiff materials alike.
inline constexpr double kStressScale = 1e4;  ///< Pa, s = kStressScale exp(kStressRate z0)
inline constexpr double kStressRate = 3.0;
inline constexpr double kStrainScale = 0.05;  ///< e = kStrainScale exp(kStrainRate z1)
inline constexpr double kStrainRate = 2.0;
inline constexpr double kTimeScale = 0.05;           ///< s, D = sym(C) kTimeScale
inline constexpr double kInvariantSmoothing = 0.05;  ///< d: rounds the kink of the norms at 0
inline constexpr double kSinhLimit = 12;             ///< of outputs whose sinh is a coefficient
inline constexpr double kFlowStep = 2e-4;        ///< s, the time step that sinh(η̃) belongs to
inline constexpr double kLeastViscosity = -0.2;  ///< of v Δt₀/(b̄ Δt): the share is at most 1.25
inline constexpr double kRateScaleLimit = 6;     ///< of κ̃
inline constexpr double kRateExponentLimit = 2;  ///< of ν
inline constexpr double kExponentLimit = 4;  ///< of outputs that are exponents of strain measures
inline constexpr double kFluidCap = -0.5;    ///< c₁ below which a material has no strength at all

}  // namespace uniphy::kernels
