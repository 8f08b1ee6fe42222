#include "uniphy/training/law_columns.hpp"

#include <algorithm>
#include <cmath>

#include "ops/base/torch.hpp"
#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/spectral/spectral.hpp"

namespace uniphy {
namespace {

using kernels::SampleColumns;
using Mat3 = kernels::Mat3<double>;

Mat3 load(const std::vector<double>& values, std::int64_t sample) {
  Mat3 m;
  for (int k = 0; k < 9; ++k) m.e[k] = values[sample * 9 + k];
  return m;
}
void put(float* to, const Mat3& m) {
  for (int k = 0; k < 9; ++k) to[k] = float(m.e[k]);
}
Mat3 from_rest(Mat3 m) {
  for (int k = 0; k < 9; k += 4) m.e[k] -= 1;
  return m;
}
/// 00, 11, 22, 01, 02, 12
void put_symmetric(float* to, const Mat3& m) {
  constexpr int kEntry[6] = {0, 4, 8, 1, 2, 5};
  for (int k = 0; k < 6; ++k) to[k] = float(m.e[kEntry[k]]);
}

// A projection that changes a strain by less than this is rounding.
constexpr double kNoDecrease = 1e-11;

/// A sample, decomposed.
struct Sample {
  Mat3 F, P, C, tau;  ///< P = F_proj
  kernels::Svd3<double> svd_F, svd_P;
  kernels::HenckyStrain<double> trial, strain;  ///< of F and of P

  Sample(const LawSamples& samples, std::int64_t s)
      : F(load(samples.F, s)),
        P(load(samples.F_proj, s)),
        C(load(samples.C, s)),
        tau(load(samples.tau, s)),
        svd_F(kernels::svd3(F)),
        svd_P(kernels::svd3(P)),
        trial(kernels::hencky_strain(svd_F.sigma, false)),
        strain(kernels::hencky_strain(svd_P.sigma, false)) {}
};

void isotropic_columns(const Sample& s, float* row) {
  using Column = SampleColumns;
  const auto &trial = s.trial, &strain = s.strain;
  row[Column::trace] = float(trial.trace);
  for (int i = 0; i < 3; ++i) row[Column::deviator + i] = float(trial.deviator[i]);
  // Differences in float64: a viscoplastic law may take a millionth of the strain.
  row[Column::norm_decrease] = float(trial.norm - strain.norm);
  row[Column::trace_decrease] = float(trial.trace - strain.trace);
  row[Column::projected_trace] = float(strain.trace);
  const bool cuts = trial.norm - strain.norm > kNoDecrease;
  row[Column::norm_yields] = !cuts ? 0.0F : strain.norm < kNoDecrease ? 2.0F : 1.0F;
  row[Column::trace_yields] = trial.trace - strain.trace > kNoDecrease ? 1.0F : 0.0F;
  for (int i = 0; i < 3; ++i) row[Column::projected_deviator + i] = float(strain.deviator[i]);
  const Mat3 rate = sym(s.C) * kernels::kTimeScale, &U = s.svd_P.U;
  put_symmetric(row + Column::rate, tmul(U, mul(rate, U)));
  put_symmetric(row + Column::stress, tmul(U, mul(s.tau, U)));
}

void published_columns(const Sample& s, float* row) {
  using Column = PublishedColumns;
  float* in = row + Column::projection_in;
  put(in, from_rest(s.F));
  put(in + 9, from_rest(s.svd_F.U));
  for (int i = 0; i < 3; ++i) in[18 + i] = float(s.svd_F.sigma[i] - 1);
  put(in + 21, from_rest(transpose(s.svd_F.V_)));
  in = row + Column::stress_in;
  const Mat3 R = mult(s.svd_P.U, s.svd_P.V_);
  for (int i = 0; i < 3; ++i) in[i] = float(s.svd_P.sigma[i] - 1);
  put(in + 3, from_rest(tmul(s.P, s.P)));
  const double J = determinant(s.P), F_max = std::max(s.P(0, 0), 1e-6);
  in[12] = float(J - 1);
  in[13] = float(std::log(std::max(J, 1e-6)));
  in[14] = float(F_max - 1);
  in[15] = float(std::log(F_max));
  put(row + Column::rate_in, tmul(R, mul(s.C, R)) * kernels::kTimeScale);
  put(row + Column::delta, s.P - s.F);
  put(row + Column::stress, tmul(R, mul(s.tau, R)));
}

/// Sums over the samples of a trajectory.
struct Sums {
  double stress = 0, strain = 0, decrease = 0;

  void add(const Sample& s) {
    stress += dot(s.tau, s.tau);
    strain += dot(s.strain.eps, s.strain.eps);
    const double dq = s.trial.norm - s.strain.norm, dt = s.trial.trace - s.strain.trace;
    decrease += dq * dq + dt * dt / 3;
  }
  TrajectoryScale scale(std::int64_t samples) const {
    const double count = double(std::max<std::int64_t>(1, samples));
    TrajectoryScale s{std::sqrt(stress / count), std::sqrt(strain / count),
                      std::sqrt(decrease / count)};
    if (s.decrease < kNoDecrease) s.decrease = 0;
    return s;
  }
};

}  // namespace

LawColumns law_columns(const Dataset& data, kernels::LawForm form) {
  const bool isotropic = form == kernels::LawForm::isotropic;
  const std::int64_t columns = isotropic ? int{SampleColumns::count} : int{PublishedColumns::count};
  LawColumns result;
  result.form = form;
  result.first = data.first;
  result.values = torch::empty({data.samples.size(), columns}, torch::kFloat32);
  float* values = result.values.data_ptr<float>();
  const std::int64_t trajectories = std::int64_t(data.trajectories.size());
  result.scales.resize(std::size_t(trajectories));
#pragma omp parallel for schedule(dynamic)
  for (std::int64_t i = 0; i < trajectories; ++i) {
    Sums sums;
    for (std::int64_t k = data.first[i]; k < data.first[i + 1]; ++k) {
      const Sample sample(data.samples, k);
      float* row = values + k * columns;
      isotropic ? isotropic_columns(sample, row) : published_columns(sample, row);
      sums.add(sample);
    }
    result.scales[i] = sums.scale(data.first[i + 1] - data.first[i]);
    result.scales[i].flow_time = kernels::kFlowStep / data.trajectories[i].dt;
  }
  return result;
}

}  // namespace uniphy
