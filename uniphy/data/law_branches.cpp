#include "uniphy/data/law_branches.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "ops/kernels/spectral/svd3.hpp"
#include "uniphy/data/material_ranges.hpp"

namespace uniphy {
namespace {

using kernels::LawId;

struct Strain {
  std::array<double, 3> eps;
  double trace, deviator;  ///< tr ε, ‖ε̂‖
};

Strain hencky(const double* F) {
  kernels::Mat3<double> m;
  std::copy_n(F, 9, m.e);
  const auto svd = kernels::svd3(m);
  Strain s{};
  for (int i = 0; i < 3; ++i) {
    s.eps[static_cast<std::size_t>(i)] = std::log(std::max(0.05, svd.sigma[i]));
    s.trace += s.eps[static_cast<std::size_t>(i)];
  }
  double square = 0;
  for (const double e : s.eps) square += (e - s.trace / 3) * (e - s.trace / 3);
  s.deviator = std::sqrt(square);
  return s;
}

/// The place of q on the way through the yield surface: elastic, elastic_near, yield_near, yield.
int place_of(double q, double yield) {
  if (q <= kNearBelow * yield) return 0;
  if (q <= yield) return 1;
  return q <= kNearAbove * yield ? 2 : 3;
}

}  // namespace

const std::vector<std::string>& branch_names(LawId id) {
  static const std::vector<std::string> elastic{"rest", "small", "compressed", "stretched"};
  static const std::vector<std::string> fluid{"rest", "compressed", "expanded"};
  static const std::vector<std::string> von_mises{"elastic", "elastic_near", "yield_near", "yield"};
  static const std::vector<std::string> sand{"apex", "elastic", "elastic_near", "yield_near",
                                             "yield"};
  switch (id) {
    case LawId::newtonian:
    case LawId::water:
      return fluid;
    case LawId::plasticine:
    case LawId::non_newtonian:
      return von_mises;
    case LawId::sand:
      return sand;
    default:
      return elastic;
  }
}

SampleFeatures sample_features(const kernels::LawDescription& law, const double* F_trial,
                               const double* F_proj, const double* C) {
  const Strain trial = hencky(F_trial);
  double rate = 0;
  for (int k = 0; k < 9; ++k) rate += C[k] * C[k];
  rate = std::sqrt(rate);

  SampleFeatures f;
  f.strain = std::sqrt(trial.deviator * trial.deviator + trial.trace * trial.trace / 3);
  f.second = rate;
  const auto beyond = [&] {
    const Strain projected = hencky(F_proj);
    double square = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      square += (trial.eps[i] - projected.eps[i]) * (trial.eps[i] - projected.eps[i]);
    }
    return std::sqrt(square);
  };
  switch (law.id) {
    case LawId::newtonian:
    case LawId::water:
      f.strain = std::abs(trial.trace);
      f.branch = f.strain < kRestStrain ? 0 : trial.trace < 0 ? 1 : 2;
      break;
    case LawId::plasticine:
    case LawId::non_newtonian:
      f.branch = place_of(trial.deviator, yield_norm(law, trial.trace));
      if (f.branch >= 2) f.second = beyond();
      break;
    case LawId::sand:
      f.branch = trial.trace > 0 ? 0 : 1 + place_of(trial.deviator, yield_norm(law, trial.trace));
      if (f.branch == 0 || f.branch >= 3) f.second = beyond();
      break;
    default:
      if (f.strain < kRestStrain) {
        f.branch = 0;
      } else if (f.strain < kSmallStrain) {
        f.branch = 1;
      } else {
        f.branch = trial.trace < 0 ? 2 : 3;
      }
  }
  return f;
}

std::vector<SampleFeatures> sample_features(const kernels::LawDescription& law,
                                            const LawSamples& samples) {
  std::vector<SampleFeatures> features;
  features.reserve(static_cast<std::size_t>(samples.size()));
  for (std::size_t k = 0; k < samples.F.size(); k += 9) {
    features.push_back(sample_features(law, &samples.F[k], &samples.F_proj[k], &samples.C[k]));
  }
  return features;
}

}  // namespace uniphy
