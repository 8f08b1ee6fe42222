#include "uniphy/training/law_columns.hpp"

#include <cmath>

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
/// 00, 11, 22, 01, 02, 12
void put_symmetric(float* to, const Mat3& m) {
  constexpr int kEntry[6] = {0, 4, 8, 1, 2, 5};
  for (int k = 0; k < 6; ++k) to[k] = float(m.e[kEntry[k]]);
}

// A projection that changes a strain by less than this is rounding.
constexpr double kNoDecrease = 1e-11;

void isotropic_columns(const Dataset& data, std::int64_t s, float* row) {
  using Column = SampleColumns;
  const Mat3 F = load(data.samples.F, s), P = load(data.samples.F_proj, s);
  const auto trial = kernels::hencky_strain(kernels::svd3(F).sigma, false);
  const auto svd = kernels::svd3(P);
  const auto strain = kernels::hencky_strain(svd.sigma, false);
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
  const Mat3 rate = sym(load(data.samples.C, s)) * kernels::kTimeScale;
  put_symmetric(row + Column::rate, tmul(svd.U, mul(rate, svd.U)));
  put_symmetric(row + Column::stress, tmul(svd.U, mul(load(data.samples.tau, s), svd.U)));
}

void published_columns(const Dataset& data, std::int64_t s, float* row) {
  using Column = PublishedColumns;
  const Mat3 F = load(data.samples.F, s), P = load(data.samples.F_proj, s);
  const auto trial = kernels::svd3(F), svd = kernels::svd3(P);
  float* in = row + Column::projection_in;
  put(in, F);
  put(in + 9, trial.U);
  for (int i = 0; i < 3; ++i) in[18 + i] = float(trial.sigma[i]);
  put(in + 21, transpose(trial.V_));
  in = row + Column::stress_in;
  const Mat3 R = mult(svd.U, svd.V_);
  for (int i = 0; i < 3; ++i) in[i] = float(svd.sigma[i]);
  put(in + 3, tmul(P, P));
  const double J = determinant(P), F_max = std::max(P(0, 0), 1e-6);
  in[12] = float(J);
  in[13] = float(std::log(std::max(J, 1e-6)));
  in[14] = float(F_max);
  in[15] = float(std::log(F_max));
  put(in + 16, tmul(R, mul(load(data.samples.C, s), R)) * kernels::kTimeScale);
  put(row + Column::delta, P - F);
  put(row + Column::stress, tmul(R, mul(load(data.samples.tau, s), R)));
}

}  // namespace

LawColumns law_columns(const Dataset& data, kernels::LawForm form) {
  LawColumns result;
  const bool isotropic = form == kernels::LawForm::isotropic;
  result.columns = isotropic ? int{SampleColumns::count} : int{PublishedColumns::count};
  const std::int64_t samples = data.samples.size();
  result.values.resize(std::size_t(samples * result.columns));
#pragma omp parallel for schedule(static)
  for (std::int64_t s = 0; s < samples; ++s) {
    float* row = result.values.data() + s * result.columns;
    isotropic ? isotropic_columns(data, s, row) : published_columns(data, s, row);
  }
  const std::int64_t trajectories = std::int64_t(data.trajectories.size());
  result.scales.resize(std::size_t(trajectories));
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < trajectories; ++i) {
    double stress = 0, strain = 0, decrease = 0;
    for (std::int64_t s = data.first[i]; s < data.first[i + 1]; ++s) {
      const auto trial =
          kernels::hencky_strain(kernels::svd3(load(data.samples.F, s)).sigma, false);
      const auto projected =
          kernels::hencky_strain(kernels::svd3(load(data.samples.F_proj, s)).sigma, false);
      const Mat3 tau = load(data.samples.tau, s);
      stress += dot(tau, tau);
      strain += dot(projected.eps, projected.eps);
      const double dq = trial.norm - projected.norm, dt = trial.trace - projected.trace;
      decrease += dq * dq + dt * dt / 3;
    }
    const double count = double(std::max<std::int64_t>(1, data.first[i + 1] - data.first[i]));
    result.scales[i] = {std::sqrt(stress / count), std::sqrt(strain / count),
                        std::sqrt(decrease / count)};
    if (result.scales[i].decrease < kNoDecrease) result.scales[i].decrease = 0;
  }
  return result;
}

}  // namespace uniphy
