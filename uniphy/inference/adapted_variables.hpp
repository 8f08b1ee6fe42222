#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "uniphy/inference/fit_variables.hpp"

namespace uniphy {

/// How much of a learned law is free in a fit; each rung has the one before in it.
enum class Rung {
  latent,   ///< z alone
  numbers,  ///< and the biases of the last layers: the law's own numbers
  weights   ///< and all weights and biases of both networks
};

inline constexpr const char* kRungNames[] = {"latent", "numbers", "weights"};
const char* rung_name(Rung rung);

/// A learned law that departs from the trained one: u of z, then what is added to the free numbers
/// of the projection and the stress network, in their order in memory. Starts are those of the
/// latent variables, with nothing added.
class AdaptedVariables : public FitVariables {
 public:
  /// Of a learned law; `latent` must outlive it.
  AdaptedVariables(const FitVariables& latent, Rung rung);

  int size() const override;
  ops::RolloutBody body(const torch::Tensor& u, std::ptrdiff_t particles) const override;
  torch::Tensor prior(const torch::Tensor& u) const override { return latent_.prior(code(u)); }
  /// ‖W − W₀‖² over what this rung frees beyond the law's own numbers; undefined below `weights`.
  torch::Tensor departure(const torch::Tensor& u) const override;
  int starts() const override { return latent_.starts(); }
  std::vector<double> start(int i) const override;
  std::string label(int i) const override { return latent_.label(i); }
  std::array<double, 2> training_dt() const override { return latent_.training_dt(); }

  /// The point here that is the law of u, a point of `from`, a rung below or this one.
  torch::Tensor widened(const AdaptedVariables& from, const torch::Tensor& u) const;
  kernels::LawForm form() const { return networks_.form; }
  int latent_size() const { return latent_.size(); }
  /// What the projection's and then the stress's network answer with where every feature of the
  /// state is 0, [outputs] float64; the biases of `numbers` stand in the same order.
  torch::Tensor outputs(const torch::Tensor& u) const;
  /// Which of u are z and those of the law's own numbers that are free here.
  std::vector<std::int64_t> leading() const;
  /// Coordinates of z in u.
  torch::Tensor code(const torch::Tensor& u) const { return u.slice(0, 0, latent_.size()); }

 private:
  torch::Tensor added(const torch::Tensor& u) const;

  const FitVariables& latent_;
  ops::LearnedNetworks networks_;  ///< as trained
  torch::Tensor free_;             ///< [free] rows among the numbers of both networks
  torch::Tensor pulled_;           ///< [pulled] rows that departure() counts; empty: none
};

/// Whether the law of these variables has rungs above `latent`.
bool can_be_adapted(const FitVariables& variables);

}  // namespace uniphy
