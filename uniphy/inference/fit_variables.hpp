#pragma once

#include <torch/types.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ops/kernels/laws/law.hpp"
#include "ops/rollout/rollout.hpp"
#include "uniphy/io/latent_file.hpp"
#include "uniphy/io/model_file.hpp"

namespace uniphy {

/// What a fit looks for: a point u [size], float64, in coordinates of order one, and the law that
/// belongs to it. Immutable; calls may run at the same time.
class FitVariables {
 public:
  virtual ~FitVariables() = default;
  virtual int size() const = 0;
  /// The law of u for a differentiable roll-out of `particles`; its parameters are a function of u
  /// that gradients go through. Every body of one model shares its networks.
  virtual ops::RolloutBody body(const torch::Tensor& u, std::ptrdiff_t particles) const = 0;
  /// ‖z‖², a number that gradients go through; undefined for analytic laws, which have no prior.
  virtual torch::Tensor prior(const torch::Tensor& u) const = 0;
  /// How far the networks have left the trained ones, a number that gradients go through; undefined
  /// where they stay as they are.
  virtual torch::Tensor departure(const torch::Tensor&) const { return {}; }

  /// Points to start from and the material that each stands for.
  virtual int starts() const = 0;
  virtual std::vector<double> start(int i) const = 0;
  virtual std::string label(int i) const = 0;

  /// The analytic law that start i was trained to be, where one is known.
  virtual std::optional<kernels::LawDescription> origin(int) const { return {}; }

  /// [low, high] of each parameter of an analytic law, in the order of law_parameters(id), which
  /// starts are drawn from; empty for a learned one.
  virtual std::vector<std::array<double, 2>> ranges() const { return {}; }
  /// Of the model: ModelFile::training_dt; 0 for analytic laws, which know the time step.
  virtual std::array<double, 2> training_dt() const { return {}; }

  /// The law of u for the kernels and for files.
  kernels::LawDescription law(const torch::Tensor& u) const;
  kernels::LawDescription law(const std::vector<double>& u) const;
  /// The known points nearest to u, nearest first; not those of laws drawn at random, which name
  /// nothing, unless there are no others.
  std::vector<NearestCode> nearest(const std::vector<double>& u, int count) const;
};

/// The latent code of a trained model: u_k = (z_k − mean_k)/spread_k over the training codes (a
/// spread of 0 counts as 1). It starts from those codes.
std::unique_ptr<const FitVariables> make_latent_variables(const ModelFile& model);

/// The same variables with one more start, the last one: u, called as the known point nearest to
/// it. `variables` must outlive it.
std::unique_ptr<const FitVariables> with_start(const FitVariables& variables,
                                               const std::vector<double>& u);

/// The parameters of an analytic law: u = (log p − middle)/half width over `ranges` of the
/// logarithm, one [low, high] for each of law_parameters(id). Starts are drawn from them; a fit may
/// leave them. A parameter with low = high is a constant and has no place in u. Throws Error where
/// all are constants.
std::unique_ptr<const FitVariables> make_analytic_variables(
    kernels::LawId id, const std::vector<std::array<double, 2>>& ranges, int starts,
    std::uint64_t seed);

/// The ranges that the project draws the parameters of a law from, in the order of
/// law_parameters(id).
std::vector<std::array<double, 2>> default_ranges(kernels::LawId id);

}  // namespace uniphy
