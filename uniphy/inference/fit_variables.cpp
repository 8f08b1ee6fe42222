#include "uniphy/inference/fit_variables.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "ops/kernels/base/error.hpp"
#include "uniphy/data/material_ranges.hpp"
#include "uniphy/geometry/random.hpp"

namespace uniphy {
namespace {

class LatentFitVariables : public FitVariables {
 public:
  explicit LatentFitVariables(const ModelFile& model)
      : weights_(std::make_shared<kernels::LearnedLawWeights>(model.weights)),
        materials_(model.materials),
        size_(model.weights.latent_size),
        mean_(size_, 0.0),
        spread_(size_, 1.0) {
    const auto codes = static_cast<int>(model.codes());
    if (codes == 0) throw Error("model: expected latent codes to start from, found none");
    for (int k = 0; k < size_; ++k) {
      double sum = 0, squares = 0;
      for (int i = 0; i < codes; ++i) sum += model.latents[i * size_ + k];
      mean_[k] = sum / codes;
      for (int i = 0; i < codes; ++i)
        squares += std::pow(model.latents[i * size_ + k] - mean_[k], 2);
      if (squares > 0) spread_[k] = std::sqrt(squares / codes);
    }
    for (int i = 0; i < codes; ++i) {
      std::vector<double> u = model.code(i);
      for (int k = 0; k < size_; ++k) u[k] = (u[k] - mean_[k]) / spread_[k];
      starts_.push_back(std::move(u));
    }
  }

  int size() const override { return size_; }

  kernels::LawDescription law(const std::vector<double>& u) const override {
    kernels::LawDescription description;
    description.id = kernels::LawId::learned;
    description.weights = weights_;
    description.z.resize(size_);
    for (int k = 0; k < size_; ++k) description.z[k] = mean_[k] + spread_[k] * u[k];
    return description;
  }

  std::vector<double> gradient(const std::vector<double>&,
                               const std::vector<double>& by_parameters) const override {
    std::vector<double> g(size_);
    for (int k = 0; k < size_; ++k) g[k] = spread_[k] * by_parameters[k];
    return g;
  }

  double prior(const std::vector<double>& u, double weight,
               std::vector<double>* gradient) const override {
    double sum = 0;
    for (int k = 0; k < size_; ++k) {
      const double z = mean_[k] + spread_[k] * u[k];
      sum += z * z;
      if (gradient != nullptr) (*gradient)[k] += weight * 2 * z * spread_[k];
    }
    return sum;
  }

  int starts() const override { return static_cast<int>(starts_.size()); }
  std::vector<double> start(int i) const override { return starts_[i]; }
  std::string label(int i) const override { return materials_[i]; }

 private:
  std::shared_ptr<const kernels::LearnedLawWeights> weights_;
  std::vector<std::string> materials_;
  int size_;
  std::vector<double> mean_, spread_;
  std::vector<std::vector<double>> starts_;
};

class AnalyticFitVariables : public FitVariables {
 public:
  AnalyticFitVariables(kernels::LawId id, const std::vector<std::array<double, 2>>& ranges,
                       int starts, std::uint64_t seed)
      : id_(id), parameters_(kernels::law_parameters(id)) {
    if (ranges.size() != parameters_.size()) {
      throw Error(std::string("law ") + kernels::law_name(id) + ": expected " +
                  std::to_string(parameters_.size()) + " ranges, found " +
                  std::to_string(ranges.size()));
    }
    for (const auto& range : ranges) {
      middle_.push_back(0.5 * (std::log(range[0]) + std::log(range[1])));
      half_.push_back(std::max(0.5 * (std::log(range[1]) - std::log(range[0])), 1e-3));
    }
    UniformRandom random(seed);
    for (int i = 0; i < starts; ++i) {
      std::vector<double> u;
      for (std::size_t k = 0; k < parameters_.size(); ++k) u.push_back(random.between(-1, 1));
      starts_.push_back(std::move(u));
    }
  }

  int size() const override { return static_cast<int>(parameters_.size()); }

  kernels::LawDescription law(const std::vector<double>& u) const override {
    kernels::LawDescription description;
    description.id = id_;
    for (int k = 0; k < size(); ++k) {
      description.*parameters_[k].member = std::exp(middle_[k] + half_[k] * u[k]);
    }
    return description;
  }

  std::vector<double> gradient(const std::vector<double>& u,
                               const std::vector<double>& by_parameters) const override {
    std::vector<double> g(size());
    for (int k = 0; k < size(); ++k) {
      g[k] = by_parameters[k] * half_[k] * std::exp(middle_[k] + half_[k] * u[k]);
    }
    return g;
  }

  double prior(const std::vector<double>&, double, std::vector<double>*) const override {
    return 0;
  }

  int starts() const override { return static_cast<int>(starts_.size()); }
  std::vector<double> start(int i) const override { return starts_[i]; }
  std::string label(int) const override { return kernels::law_name(id_); }

 private:
  kernels::LawId id_;
  const std::vector<kernels::LawParameter>& parameters_;
  std::vector<double> middle_, half_;
  std::vector<std::vector<double>> starts_;
};

}  // namespace

std::vector<NearestCode> FitVariables::nearest(const std::vector<double>& u, int count) const {
  std::vector<NearestCode> all;
  for (int i = 0; i < starts(); ++i) {
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

std::unique_ptr<const FitVariables> make_analytic_variables(
    kernels::LawId id, const std::vector<std::array<double, 2>>& ranges, int starts,
    std::uint64_t seed) {
  return std::make_unique<AnalyticFitVariables>(id, ranges, starts, seed);
}

std::vector<std::array<double, 2>> default_ranges(kernels::LawId id) {
  // The laws beside the five are elastic at small strain.
  const bool other = id == kernels::LawId::fixed_corotated || id == kernels::LawId::water;
  const kernels::LawId like = other ? kernels::LawId::elastic : id;
  std::vector<std::array<double, 2>> ranges;
  for (const MaterialRanges& material : default_material_ranges()) {
    if (material.id != like) continue;
    for (const kernels::LawParameter& p : kernels::law_parameters(id))
      ranges.push_back(material.interval[p.place]);
  }
  return ranges;
}

}  // namespace uniphy
