#include "uniphy/inference/observation_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/uniphy/inference/observed_scene.hpp"
#include "uniphy/inference/observed_noise.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;

ObservationCheck check(const Observation& o) {
  const ObservedSteps steps = observed_steps(o, "o");
  const kernels::GridSettings grid = observed_grid(o, "o");
  return check_observation(o, steps, grid);
}

Observation with_noise(Observation o, double share, unsigned seed = 2) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, share * observed_size(o));
  for (double& x : o.x) x += noise(random);
  return o;
}

/// The observation from frame `first` on.
Observation cut(Observation o, std::ptrdiff_t first) {
  o.x.erase(o.x.begin(), o.x.begin() + first * 3 * o.particles);
  o.time.erase(o.time.begin(), o.time.begin() + first);
  for (std::size_t f = o.time.size(); f-- > 0;) o.time[f] -= o.time[0];
  o.frames -= first;
  return o;
}

double height(const Observation& o, std::ptrdiff_t frame) {
  double low = 1, high = 0;
  for (std::int64_t p = 0; p < o.particles; ++p) {
    low = std::min(low, o.positions(frame)[3 * p + 1]);
    high = std::max(high, o.positions(frame)[3 * p + 1]);
  }
  return high - low;
}

std::ptrdiff_t deepest(const Observation& o) {
  std::ptrdiff_t best = 0;
  for (std::ptrdiff_t f = 1; f < o.frames; ++f) {
    if (height(o, f) < height(o, best)) best = f;
  }
  return best;
}

/// A soft cube of 5 kPa that falls on the floor at 2 m/s and comes back.
Observation soft_cube() {
  testing::ObservedScene scene;
  scene.frames = 81;
  scene.every = 8;
  scene.motion = {{0.5, 0.45, 0.5}, {0, -2, 0}, {0, 0, 0}};
  return testing::observe(testing::elastic_body(5e3, 7.5e3), scene);
}

kernels::LawDescription law_of(kernels::LawId id, double mu, double lambda) {
  kernels::LawDescription law;
  law.id = id;
  law.mu = mu;
  law.lambda = lambda;
  law.theta = 0.3;
  law.tau_y = 0.02 * mu;
  law.eta = 1;
  return law;
}

TEST(ObservationCheck, NoRigidStartIsDoubted) {
  using kernels::LawId;
  for (const auto& law :
       {law_of(LawId::elastic, 2e3, 3e3), law_of(LawId::elastic, 2e5, 3e5),
        law_of(LawId::newtonian, 50, 1e4), law_of(LawId::sand, 1e5, 1e5),
        law_of(LawId::plasticine, 5e4, 1e5), law_of(LawId::non_newtonian, 1e4, 1e5)}) {
    for (const Eigen::Vector3d& turning : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, -2, 3),
                                           Eigen::Vector3d(0, 10, 0), Eigen::Vector3d(20, 0, 20)}) {
      for (const double centre : {0.34, 0.36, 0.5}) {  // on the wall, above it, far from it
        testing::ObservedScene scene;
        scene.motion = {{0.5, centre, 0.5}, {0.4, -1.5, -0.3}, turning};
        scene.frames = 21;
        const Observation o = testing::observe(law, scene);
        SCOPED_TRACE(::testing::Message() << kernels::law_name(law.id) << " mu " << law.mu << " at "
                                          << centre << " turning " << turning.transpose());
        for (const Observation& seen : {o, with_noise(o, 1e-3), with_noise(o, 5e-3)}) {
          const ObservationCheck found = check(seen);
          EXPECT_FALSE(start_warning(found).has_value()) << *start_warning(found);
          if (centre == 0.5) {
            EXPECT_GE(found.free_frames, 1);
          }
        }
      }
    }
  }
}

TEST(ObservationCheck, ABodyAtRestOnTheFloorIsNotDoubted) {
  testing::ObservedScene scene;
  scene.motion = {{0.5, 0.32, 0.5}, {0, 0, 0}, {0, 0, 0}};
  for (const double mu : {2e3, 2e5}) {
    const Observation o = testing::observe(testing::elastic_body(mu, mu), scene);
    for (const Observation& seen : {o, with_noise(o, 5e-3)}) {
      const ObservationCheck found = check(seen);
      EXPECT_FALSE(start_warning(found).has_value()) << *start_warning(found);
    }
  }
}

TEST(ObservationCheck, ACompressedStartGainsEnergy) {
  const Observation whole = soft_cube();
  const std::ptrdiff_t first = deepest(whole);
  ASSERT_LT(height(whole, first), 0.8 * height(whole, 0));
  for (const double noise : {0.0, 5e-3}) {
    SCOPED_TRACE(noise);
    EXPECT_FALSE(start_warning(check(with_noise(whole, noise))).has_value());
    const ObservationCheck found = check(with_noise(cut(whole, first), noise));
    EXPECT_GT(found.energy_gain, 0.5);
    EXPECT_GT(found.energy_gain, found.energy_allowed);
    ASSERT_TRUE(start_warning(found).has_value());
    EXPECT_THAT(*start_warning(found), HasSubstr("its centre of mass gains"));
  }
}

TEST(ObservationCheck, ABodyThatRingsInTheAirIsNotRigid) {
  const Observation whole = soft_cube();
  // The first frames at which it flies again, after the bounce.
  std::ptrdiff_t first = deepest(whole);
  while (check(cut(whole, first)).free_frames < kStartFrames) {
    ++first;
    ASSERT_LT(first + kStartFrames, whole.frames);
  }
  const ObservationCheck found = check(cut(whole, first));
  EXPECT_GT(found.start_residual, 2 * found.start_allowed);
  EXPECT_THAT(start_warning(found).value_or("nothing"), HasSubstr("the best rigid motion leaves"));
  EXPECT_LT(check(whole).start_residual, 1e-9);
}

TEST(ObservationCheck, NoiseIsFoundFromThePositions) {
  const Observation o = soft_cube();
  EXPECT_LT(observed_noise(o), 2e-4 * observed_size(o));
  for (const double share : {1e-3, 5e-3, 2e-2}) {
    EXPECT_NEAR(observed_noise(with_noise(o, share)), share * observed_size(o),
                0.05 * share * observed_size(o));
  }
  Observation uneven = with_noise(o, 5e-3);
  for (std::ptrdiff_t f = uneven.frames - 2; f > 0; f -= 3) {  // every third frame is lost
    const auto at = uneven.x.begin() + f * 3 * uneven.particles;
    uneven.x.erase(at, at + 3 * uneven.particles);
    uneven.time.erase(uneven.time.begin() + f);
    --uneven.frames;
  }
  EXPECT_NEAR(observed_noise(uneven), 5e-3 * observed_size(o), 4e-4 * observed_size(o));
  uneven.time.resize(3);
  EXPECT_EQ(observed_noise(uneven), 0);
}

TEST(ObservationCheck, ContactIsSeenThroughNoiseAndFreeFlightIsNoContact) {
  const auto contact = [](const Observation& o) {
    const ObservedSteps steps = observed_steps(o, "o");
    const kernels::GridSettings grid = observed_grid(o, "o");
    return first_contact(o, steps, grid, observed_motion(o, steps, grid, 1)) < o.frames;
  };
  testing::ObservedScene scene;
  scene.frames = 25;
  for (unsigned seed = 1; seed < 6; ++seed) {
    const Observation meets = testing::observe(testing::elastic_body(), scene);
    EXPECT_TRUE(contact(with_noise(meets, 0.01, seed)));
    testing::ObservedScene high = scene;
    high.motion = {{0.5, 0.5, 0.5}, {0.4, 0.5, -0.3}, {1, -2, 3}};
    const Observation flies = testing::observe(testing::elastic_body(), high);
    EXPECT_FALSE(contact(flies));
    EXPECT_FALSE(contact(with_noise(flies, 0.005, seed)));
    EXPECT_FALSE(contact(with_noise(flies, 0.02, seed)));
  }
}

TEST(ObservationCheck, AContactOfTheLastFrameAloneIsOne) {
  const testing::ObservedScene scene;
  Observation o = testing::observe(testing::elastic_body(), scene);
  const kernels::GridSettings grid = observed_grid(o, "o");
  const auto contact_of = [&](const Observation& seen) {
    const ObservedSteps steps = observed_steps(seen, "o");
    return first_contact(seen, steps, grid, observed_motion(seen, steps, grid, 1));
  };
  const std::ptrdiff_t contact = contact_of(o);
  o.frames = contact + 1;
  o.time.resize(o.frames);
  o.x.resize(o.frames * 3 * o.particles);
  for (std::int64_t p = 0; p < o.particles; ++p) {
    o.x[3 * (contact * o.particles + p) + 1] += 0.05 * grid.dx();  // more than a fit can hide
  }
  EXPECT_EQ(contact_of(o), contact);
}

}  // namespace
}  // namespace uniphy
