// Training on laws drawn at random.

#include <gtest/gtest.h>

#include <utility>

#include "tests/uniphy/support/scratch.hpp"
#include "tests/uniphy/training/small_data.hpp"
#include "uniphy/data/random_law_samples.hpp"
#include "uniphy/io/model_file.hpp"
#include "uniphy/training/heldout_fit.hpp"
#include "uniphy/training/trained_model_file.hpp"
#include "uniphy/training/trainer.hpp"

namespace uniphy {
namespace {

/// Trajectories of laws drawn at random beside those of the families.
Dataset with_random_laws(Dataset data) {
  for (const auto& [kind, base] : {std::pair{RandomLawKind::solid, 0},
                                   {RandomLawKind::fluid, 3},
                                   {RandomLawKind::plastic, 1},
                                   {RandomLawKind::plastic, 2}}) {
    const auto part = [&](const std::vector<double>& all) {
      return std::vector<double>(all.begin() + 9 * data.first[base],
                                 all.begin() + 9 * data.first[base + 1]);
    };
    LawSamples states;
    states.F = part(data.samples.F);
    states.C = part(data.samples.C);
    TrajectoryRecord record = data.trajectories[base];
    const LawSamples drawn = draw_random_law(kind, states, record.material, record.dt, 7).samples;
    record.material = random_law_name(kind);
    data.trajectories.push_back(record);
    for (std::vector<double> LawSamples::*field :
         {&LawSamples::F, &LawSamples::F_proj, &LawSamples::C, &LawSamples::tau}) {
      (data.samples.*field)
          .insert((data.samples.*field).end(), (drawn.*field).begin(), (drawn.*field).end());
    }
    data.trajectory.insert(data.trajectory.end(), drawn.size(),
                           std::int32_t(data.trajectories.size()) - 1);
    data.first.push_back(data.samples.size());
  }
  return data;
}

TEST(RandomLaws, AreLearnedBesideTheFamilies) {
  const testing::Scratch scratch;
  const Dataset data = with_random_laws(testing::small_data(60, 1));
  TrainingOptions o = testing::small_options();
  o.steps = 200;
  o.learning_rate = 1e-2;
  const TrainingResult result = train(data, o, scratch.file("c.pt"));
  EXPECT_LT(result.history.back().loss, 0.7 * result.history.front().loss);
  EXPECT_EQ(result.model.codes->materials(),
            (std::vector<std::string>{"elastic", "plasticine", "sand", "newtonian", "random_solid",
                                      "random_fluid", "random_plastic", "random_plastic"}));
  const auto weights = std::make_shared<kernels::LearnedLawWeights>(result.model.law->weights());
  Metrics metrics;
  report_law_errors(data, law_errors(data, weights, numbers_of(result.model.codes->z)), "",
                    metrics);
  for (const char* name : {"random_solid", "random_fluid", "random_plastic", "sand"})
    EXPECT_LT(*metrics.find(std::string("stress_error.") + name), 1) << name;
  write_model(scratch.file("model.h5"), model_file(result.model, "", time_steps(data)), true);
  EXPECT_EQ(read_model(scratch.file("model.h5")).materials, result.model.codes->materials());
}

}  // namespace
}  // namespace uniphy
