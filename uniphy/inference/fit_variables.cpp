#include "uniphy/inference/fit_variables.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include "models/learned_law.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/law_parameters.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/data/random_law.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {
namespace {

torch::Tensor to_tensor(const std::vector<double>& numbers) {
  return torch::tensor(numbers, torch::kFloat64);
}

class LatentFitVariables : public FitVariables {
 public:
  explicit LatentFitVariables(const ModelFile& file) : training_dt_(file.training_dt) {
    if (file.codes() == 0) throw Error("model: expected latent codes to start from, found none");
    law_ = models::LearnedLaw(file.weights, torch::kFloat64)->frozen();
    materials_ = file.materials;
    parameters_ = file.parameters;
    const auto codes = static_cast<int>(materials_.size());
    const torch::Tensor z = to_tensor(file.latents).view({codes, file.weights.latent_size});
    mean_ = z.mean(0);
    const torch::Tensor spread = z.std(0, /*unbiased=*/false);
    spread_ = torch::where(spread > 0, spread, torch::ones_like(spread));
    const torch::Tensor u = ((z - mean_) / spread_).contiguous();
    for (int i = 0; i < codes; ++i) {
      const double* row = u.data_ptr<double>() + i * size();
      starts_.emplace_back(row, row + size());
    }
  }

  int size() const override { return static_cast<int>(law_->latent_size()); }

  ops::RolloutBody body(const torch::Tensor& u, std::ptrdiff_t particles) const override {
    kernels::LawDescription law;
    law.id = kernels::LawId::learned;
    law.weights = ops::kernel_weights(law_->networks());
    return {0, particles, law, code(u), law_->networks()};
  }

  torch::Tensor prior(const torch::Tensor& u) const override { return code(u).square().sum(); }

  int starts() const override { return static_cast<int>(starts_.size()); }
  std::vector<double> start(int i) const override { return starts_[i]; }
  std::string label(int i) const override { return materials_[i]; }
  std::array<double, 2> training_dt() const override { return training_dt_; }
  std::optional<kernels::LawDescription> origin(int i) const override {
    if (is_random_law(materials_[i]) || std::isnan(parameters_[i][0])) return {};
    kernels::LawDescription law;
    law.id = kernels::law_id(materials_[i]);
    for (const kernels::LawParameter& p : kernels::law_parameters(law.id)) {
      law.*p.member = parameters_[i][static_cast<std::size_t>(p.place)];
      if (std::isnan(law.*p.member)) return {};
    }
    return law;
  }

 private:
  torch::Tensor code(const torch::Tensor& u) const { return mean_ + spread_ * u; }

  models::LearnedLaw law_{nullptr};  // frozen
  std::vector<std::string> materials_;
  std::vector<MaterialParameters> parameters_;
  std::array<double, 2> training_dt_;  // s
  torch::Tensor mean_, spread_;        // [latent size]
  std::vector<std::vector<double>> starts_;
};

class AnalyticFitVariables : public FitVariables {
 public:
  AnalyticFitVariables(kernels::LawId id, const std::vector<std::array<double, 2>>& ranges,
                       int starts, std::uint64_t seed)
      : id_(id), ranges_(ranges) {
    const std::size_t count = kernels::law_parameters(id).size();
    if (ranges.size() != count) {
      throw Error(std::string("law ") + kernels::law_name(id) + ": expected " +
                  std::to_string(count) + " ranges, found " + std::to_string(ranges.size()));
    }
    std::vector<double> middle, half;
    std::vector<std::int64_t> fitted;
    for (std::size_t k = 0; k < count; ++k) {
      const auto& [low, high] = ranges[k];
      middle.push_back(0.5 * (std::log(low) + std::log(high)));
      if (low == high) {
        fixed_.emplace_back(k, low);
        half.push_back(0);
        continue;
      }
      fitted.push_back(static_cast<std::int64_t>(k));
      half.push_back(std::max(0.5 * (std::log(high) - std::log(low)), 1e-3));
    }
    size_ = static_cast<int>(fitted.size());
    if (size_ == 0) {
      throw Error(std::string("law ") + kernels::law_name(id) +
                  ": expected a parameter with a range of more than one value, found constants");
    }
    middle_ = to_tensor(middle);
    widths_ = torch::diag(to_tensor(half)).index_select(1, torch::tensor(fitted)).contiguous();
    UniformRandom random(seed);
    for (int i = 0; i < starts; ++i) {
      std::vector<double> u;
      for (int k = 0; k < size_; ++k) u.push_back(random.between(-1, 1));
      starts_.push_back(std::move(u));
    }
  }

  int size() const override { return size_; }

  ops::RolloutBody body(const torch::Tensor& u, std::ptrdiff_t particles) const override {
    kernels::LawDescription law;
    law.id = id_;
    torch::Tensor parameters = (middle_ + widths_.mv(u)).exp();
    // The value itself: the exponential of a logarithm differs from it in the last bits.
    for (const auto& [k, value] : fixed_) {
      parameters = parameters.index_fill(0, torch::tensor({static_cast<std::int64_t>(k)}), value);
    }
    return {0, particles, law, parameters};
  }

  torch::Tensor prior(const torch::Tensor&) const override { return {}; }

  int starts() const override { return static_cast<int>(starts_.size()); }
  std::vector<double> start(int i) const override { return starts_[i]; }
  std::string label(int) const override { return kernels::law_name(id_); }
  std::vector<std::array<double, 2>> ranges() const override { return ranges_; }

 private:
  kernels::LawId id_;
  std::vector<std::array<double, 2>> ranges_;
  int size_ = 0;                                       ///< of the parameters that are no constants
  std::vector<std::pair<std::size_t, double>> fixed_;  ///< constants and their places
  torch::Tensor middle_;                               ///< [parameters]
  torch::Tensor widths_;  ///< [parameters, size]: half widths, a column each
  std::vector<std::vector<double>> starts_;
};

class StartedFitVariables : public FitVariables {
 public:
  StartedFitVariables(const FitVariables& variables, std::vector<double> u)
      : of_(variables), u_(std::move(u)), label_(variables.nearest(u_, 1).front().material) {}

  int size() const override { return of_.size(); }
  ops::RolloutBody body(const torch::Tensor& u, std::ptrdiff_t particles) const override {
    return of_.body(u, particles);
  }
  torch::Tensor prior(const torch::Tensor& u) const override { return of_.prior(u); }
  torch::Tensor departure(const torch::Tensor& u) const override { return of_.departure(u); }
  int starts() const override { return of_.starts() + 1; }
  std::vector<double> start(int i) const override { return is_added(i) ? u_ : of_.start(i); }
  std::string label(int i) const override { return is_added(i) ? label_ : of_.label(i); }
  std::optional<kernels::LawDescription> origin(int i) const override {
    return is_added(i) ? std::nullopt : of_.origin(i);
  }
  std::vector<std::array<double, 2>> ranges() const override { return of_.ranges(); }
  std::array<double, 2> training_dt() const override { return of_.training_dt(); }

 private:
  bool is_added(int i) const { return i == of_.starts(); }

  const FitVariables& of_;
  std::vector<double> u_;
  std::string label_;
};

}  // namespace

kernels::LawDescription FitVariables::law(const torch::Tensor& u) const {
  const ops::RolloutBody at = body(u.detach(), 0);
  return kernels::with_parameters(at.law, at.parameters.data_ptr<double>());
}

kernels::LawDescription FitVariables::law(const std::vector<double>& u) const {
  return law(to_tensor(u));
}

std::vector<NearestCode> FitVariables::nearest(const std::vector<double>& u, int count) const {
  // Laws drawn at random name nothing; a model of nothing else gives what it has.
  bool named = false;
  for (int i = 0; i < starts(); ++i) named = named || !is_random_law(label(i));
  std::vector<NearestCode> all;
  for (int i = 0; i < starts(); ++i) {
    if (named && is_random_law(label(i))) continue;
    const std::vector<double> at = start(i);
    double square = 0;
    for (int k = 0; k < size(); ++k) square += (at[k] - u[k]) * (at[k] - u[k]);
    all.push_back({i, std::sqrt(square), label(i)});
  }
  std::stable_sort(all.begin(), all.end(), [](const NearestCode& a, const NearestCode& b) {
    return a.distance < b.distance;
  });
  all.resize(std::min<std::size_t>(all.size(), count));
  return all;
}

std::unique_ptr<const FitVariables> make_latent_variables(const ModelFile& model) {
  return std::make_unique<LatentFitVariables>(model);
}

std::unique_ptr<const FitVariables> with_start(const FitVariables& variables,
                                               const std::vector<double>& u) {
  return std::make_unique<StartedFitVariables>(variables, u);
}

std::unique_ptr<const FitVariables> make_analytic_variables(
    kernels::LawId id, const std::vector<std::array<double, 2>>& ranges, int starts,
    std::uint64_t seed) {
  return std::make_unique<AnalyticFitVariables>(id, ranges, starts, seed);
}

namespace {

/// The family whose ranges a law begins with.
kernels::LawId nearest_family(kernels::LawId id) {
  using kernels::LawId;
  switch (id) {
    case LawId::fixed_corotated:
    case LawId::water:
    case LawId::mooney_rivlin:
      return LawId::elastic;  // at small strain
    case LawId::carreau:
    case LawId::herschel_bulkley:
      return LawId::non_newtonian;
    case LawId::cohesive_sand:
    case LawId::volume_corrected_sand:
      return LawId::sand;
    default:
      return id;
  }
}

}  // namespace

std::vector<std::array<double, 2>> default_ranges(kernels::LawId id) {
  // Where the five have no such parameter.
  static const std::map<std::string, std::array<double, 2>> outside{
      {"c1", {200, 1e6}},    {"c2", {20, 1e5}}, {"eta_inf", {0.1, 100}},
      {"kappa", {1e-3, 10}}, {"n", {0.2, 1.8}}, {"cohesion", {1e-4, 0.1}}};
  std::vector<std::array<double, 2>> ranges;
  for (const MaterialRanges& material : default_material_ranges()) {
    if (material.id != nearest_family(id)) continue;
    for (const kernels::LawParameter& p : kernels::law_parameters(id)) {
      const auto found = outside.find(p.name);
      ranges.push_back(found != outside.end() ? found->second : material.interval[p.place]);
    }
  }
  return ranges;
}

}  // namespace uniphy
