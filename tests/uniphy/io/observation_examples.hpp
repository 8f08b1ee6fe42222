#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/observation.hpp"

namespace uniphy::testing {

/// Two particles in three frames.
inline Observation example() {
  Observation o;
  o.frames = 3;
  o.particles = 2;
  for (int i = 0; i < 18; ++i) o.x.push_back(0.01 * i);
  o.time = {0, 0.1, 0.2};
  o.volume = {1e-6, 2e-6};
  o.grid = 32;
  o.dt = 2.5e-4;
  o.gravity = {0, -1.6, 0.1};
  o.walls = "noslip";
  o.bound = 4;
  o.density = 1500;
  return o;
}

/// The group of a file that is written by hand.
inline void write_scene(hdf5::Writer& w) {
  w.group("scene");
  w.attribute("scene", "grid", 20);
  w.attribute("scene", "dt", 1e-3);
  w.attribute("scene", "gravity", std::vector<double>{0, -9.8, 0});
  w.attribute("scene", "walls", "freeslip");
  w.attribute("scene", "bound", 3);
  w.attribute("scene", "density", 1000.0);
}

/// Clouds of 2, 0 and 1 points in two rows beside three particles.
inline Observation cloud_example() {
  Observation o = example();
  o.body = {0.1, 0.1, 0.1, 0.2, 0.1, 0.1, 0.1, 0.3, 0.1};
  o.particles = 3;
  o.volume = {1e-6, 2e-6, 3e-6};
  o.cloud = 2;
  std::fill(o.x.begin() + 6, o.x.begin() + 15, std::nan(""));
  return o;
}

/// A position as itself, NaN as a number that is none.
inline std::vector<double> comparable(std::vector<double> x) {
  for (double& v : x) v = std::isnan(v) ? -1 : v;
  return x;
}

}  // namespace uniphy::testing
