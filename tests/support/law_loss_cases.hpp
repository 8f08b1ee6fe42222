#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "ops/kernels/learned/learned_law_weights.hpp"
#include "ops/kernels/loss/sample_columns.hpp"

namespace uniphy::testing {

/// Random samples of the isotropic form in which every branch of the errors occurs, and answers to
/// them. Row-major, float64.
struct LawLossCase {
  std::int64_t trajectories, samples, table = 50, latent = 3;
  bool state_caps, state_moduli;
  std::vector<double> columns;     ///< [table, SampleColumns::count]
  std::vector<std::int64_t> rows;  ///< [trajectories, samples]
  std::vector<double> scales;      ///< [trajectories, 4]
  std::vector<double> z;           ///< [trajectories, latent]
  std::vector<double> caps, caps_rest, moduli, moduli_rest;
  double floor = 0.1, delta = 1e-3;
};

inline LawLossCase law_loss_case(std::int64_t trajectories, std::int64_t samples, bool state_caps,
                                 bool state_moduli) {
  using Column = kernels::SampleColumns;
  LawLossCase c;
  c.trajectories = trajectories;
  c.samples = samples;
  c.state_caps = state_caps;
  c.state_moduli = state_moduli;
  std::mt19937 random(unsigned(17 + samples));
  std::normal_distribution<double> normal;
  const auto deviator = [&](double* to, double size) {
    for (int i = 0; i < 3; ++i) to[i] = size * normal(random);
    const double mean = (to[0] + to[1] + to[2]) / 3;
    for (int i = 0; i < 3; ++i) to[i] -= mean;
    return std::sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
  };
  for (std::int64_t s = 0; s < c.table; ++s) {
    std::vector<double> row(Column::count);
    const int kind = int(s % 3), cuts_trace = int(s / 3 % 2);
    const double norm = deviator(&row[Column::deviator], 0.08);
    row[Column::trace] = 0.08 * normal(random);
    row[Column::norm_yields] = kind;
    row[Column::trace_yields] = cuts_trace;
    row[Column::norm_decrease] = kind == 2 ? norm : kind == 1 ? 0.3 * norm : 0;
    row[Column::trace_decrease] = cuts_trace ? std::abs(0.03 * normal(random)) : 0;
    row[Column::projected_trace] = row[Column::trace] - row[Column::trace_decrease];
    deviator(&row[Column::projected_deviator], kind == 2 ? 0 : 0.06);
    for (int k = 0; k < 6; ++k) {
      row[Column::rate + k] = 0.5 * normal(random);
      row[Column::stress + k] = 2e3 * normal(random);
    }
    c.columns.insert(c.columns.end(), row.begin(), row.end());
  }
  for (std::int64_t k = 0; k < trajectories * samples; ++k)
    c.rows.push_back(std::int64_t(random() % std::uint64_t(c.table)));
  for (std::int64_t i = 0; i < trajectories; ++i) {
    c.scales.insert(c.scales.end(),
                    {3e3, 0.1, i % 2 ? 0 : 0.05, i % 3 ? 0.4 : 2});  // every other one: elastic
    for (std::int64_t k = 0; k < c.latent; ++k) c.z.push_back(0.3 * normal(random));
  }
  const auto fill = [&](std::vector<double>& to, std::int64_t count, std::int64_t outputs) {
    for (std::int64_t k = 0; k < trajectories * count * outputs; ++k)
      to.push_back(0.7 * normal(random));
  };
  fill(c.caps, state_caps ? samples : 1, kernels::kCapOutputs);
  fill(c.caps_rest, 1, kernels::kCapOutputs);
  fill(c.moduli, state_moduli ? samples : 1, kernels::kStressOutputs);
  fill(c.moduli_rest, 1, kernels::kStressOutputs);
  return c;
}

/// Few samples and many, none of the latter a multiple of a vector; answers to the state and not.
inline std::vector<LawLossCase> law_loss_cases() {
  std::vector<LawLossCase> all;
  for (const std::int64_t samples : {1, 7, 37})
    for (const bool caps : {false, true})
      for (const bool moduli : {false, true})
        all.push_back(law_loss_case(4, samples, caps, moduli));
  return all;
}

}  // namespace uniphy::testing
