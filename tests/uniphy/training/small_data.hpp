#pragma once

#include <cmath>
#include <random>

#include "ops/kernels/laws/law.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/training/training_options.hpp"

namespace uniphy::testing {

/// `count` random states of each law, through the law itself.
inline Dataset small_data(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Dataset data;
  data.first = {0};
  const auto add = [&](kernels::LawDescription law) {
    TrajectoryRecord record;
    record.material = kernels::law_name(law.id);
    record.dt = 1e-4;
    record.density = 1000;
    data.trajectories.push_back(record);
    const std::size_t at = data.samples.F.size();
    for (int s = 0; s < count; ++s) {
      const double size = std::pow(10.0, -3 + 2 * double(s) / count);
      for (int k = 0; k < 9; ++k) {
        data.samples.F.push_back((k % 4 == 0) + size * normal(random));
        data.samples.C.push_back(5 * normal(random));
      }
      data.trajectory.push_back(std::int32_t(data.trajectories.size()) - 1);
    }
    data.samples.F_proj.resize(data.samples.F.size());
    data.samples.tau.resize(data.samples.F.size());
    const auto kernel = kernels::make_law<double>(law);
    kernel->evaluate(count, 1e-4, {data.samples.F.data() + at, 9, 1},
                     {data.samples.C.data() + at, 9, 1}, {data.samples.F_proj.data() + at, 9, 1},
                     {data.samples.tau.data() + at, 9, 1});
    data.first.push_back(data.samples.size());
  };
  kernels::LawDescription law;
  law.mu = 1e5;
  law.lambda = 2e5;
  add(law);
  law.id = kernels::LawId::plasticine;
  law.tau_y = 5e3;
  add(law);
  law.id = kernels::LawId::sand;
  law.theta = 0.3;
  add(law);
  law.id = kernels::LawId::newtonian;
  law.mu = 300;
  add(law);
  return data;
}

inline TrainingOptions small_options(kernels::LawForm form = kernels::LawForm::isotropic) {
  TrainingOptions o;
  o.law.form = form;
  o.law.latent_size = 4;
  o.law.hidden_layers = 2;
  o.law.width = 16;
  o.steps = 60;
  o.batch_per_trajectory = 32;
  o.checkpoint_every = 25;
  return o;
}

}  // namespace uniphy::testing
