#pragma once

#include <cstddef>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "ops/kernels/rollout/rollout.hpp"
#include "tests/ops/kernels/rollout/simple_law.hpp"

namespace uniphy::kernels {

/// Two random clouds of one body each, in motion and strained, near the wall at y = 0.
template <class T>
struct TwoBodies {
  std::ptrdiff_t particles;
  GridSettings grid;
  std::vector<T> mass, volume;
  ParticleState<T> state;
  T chi = 0;  ///< Pa; above 0, the second body has memory
  double parameters[2][4] = {{1e5, 2e5, 300, 0.01}, {3e4, 5e4, 100, 0.02}};

  explicit TwoBodies(std::ptrdiff_t count, unsigned seed = 1) : particles(count) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    grid.dt = 2e-4;
    const double v = 0.027 / double(count);
    std::vector<T> x;
    std::vector<T> velocity;
    const double centre[3] = {0.35, 0.31, 0.45}, v0[3] = {1, -2.5, -0.5};
    for (std::ptrdiff_t p = 0; p < count; ++p) {
      for (int a = 0; a < 3; ++a) x.push_back(T(centre[a] + 0.15 * uniform(random)));
      for (int a = 0; a < 3; ++a) velocity.push_back(T(v0[a] + uniform(random)));
      volume.push_back(T(v * (1 + 0.3 * uniform(random))));
      mass.push_back(T(1000 * v * (1 + 0.3 * uniform(random))));
    }
    state = ParticleState<T>::undeformed(x, velocity);
    for (T& c : state.C) c = T(3 * uniform(random));
    for (T& f : state.F) f += T(0.05 * uniform(random));
  }
  Rollout<T> rollout() const {
    std::vector<BodyRange<T>> bodies;
    for (int b = 0; b < 2; ++b) {
      const double* p = parameters[b];
      std::shared_ptr<const LawKernel<T>> law =
          std::make_shared<SimpleLaw<T>>(p[0], p[1], p[2], p[3]);
      if (b == 1 && chi > 0) {
        law = std::make_shared<SimpleMemoryLaw<T>>(SimpleLaw<T>(p[0], p[1], p[2], p[3]), chi);
      }
      bodies.push_back(
          {b == 0 ? 0 : particles / 3, b == 0 ? particles / 3 : particles, std::move(law)});
    }
    return {grid, bodies, mass, volume};
  }
};

/// A random linear functional of the frames.
template <class T>
struct Loss {
  std::ptrdiff_t steps = 50, every = 7;

  std::vector<T> weights(std::ptrdiff_t count, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::vector<T> w(static_cast<std::size_t>(count));
    for (T& x : w) x = T(uniform(random));
    return w;
  }
  double operator()(const Rollout<T>& rollout, const ParticleState<T>& initial,
                    RolloutGradient<T>* gradient = nullptr) const {
    const std::ptrdiff_t size = 3 * rollout.particles() * rollout.frame_count(steps, every);
    std::vector<T> x(size), v(size);
    RolloutTape<T> tape;
    rollout.record(initial, steps, every, x.data(), v.data(), &tape);
    const std::vector<T> wx = weights(size, 3), wv = weights(size, 4);
    double sum = 0;
    for (std::ptrdiff_t k = 0; k < size; ++k) sum += wx[k] * x[k] + 0.1 * wv[k] * v[k];
    if (gradient != nullptr) {
      std::vector<T> gv = wv;
      for (T& g : gv) g *= T(0.1);
      *gradient = rollout.adjoint(tape, wx.data(), gv.data());
    }
    return sum;
  }
};

}  // namespace uniphy::kernels
