#pragma once

#include <string>
#include <vector>

#include "uniphy/data/laboratory_view.hpp"
#include "uniphy/evaluation/forecast.hpp"
#include "uniphy/evaluation/outside_scenes.hpp"

namespace uniphy {

/// How the motion of a scene is observed.
enum class OpenWorldCase {
  closed,   ///< all particles in all frames, from the simulator, grid and time step of the fit
  noise,    ///< the same with noise
  tracked,  ///< a tenth of the particles as tracked points, every tenth frame, with noise
  hidden,   ///< the same, and a third of their positions hidden
  finer,    ///< all particles, from a grid twice as fine with a quarter of the time step and eight
            ///< times the particles, of which means of 2×2×2 are seen; a cube alone
  cloud,  ///< half of the particles as a cloud without correspondence, others in every frame, with
          ///< noise, every other frame
  deformed  ///< all particles, from a fifth of the time on, at which the body has met the floor;
            ///< its state there is fitted as polynomials of degree 2
};
inline constexpr const char* kOpenWorldCases[] = {"closed", "noise", "tracked", "hidden",
                                                  "finer",  "cloud", "deformed"};
const char* case_name(OpenWorldCase c);
/// How a laboratory sees a whole motion in a case; noise: standard deviation of a coordinate over
/// the size of the body. Of `finer` it is the motion itself.
Observation seen_in(OpenWorldCase c, const Observation& whole, double noise, std::uint64_t seed);

struct OpenWorldMotion {
  JudgedMotion motion;
  double floor = 0;  ///< forecast_error of the true law with the true initial state
};

/// The law's motion in a scene as a case has it; noise: standard deviation of a coordinate over the
/// size. Throws Error where the simulation fails, or of `finer` where the body is no lattice that
/// can be made finer.
OpenWorldMotion open_world_motion(const OutsideScene& scene, const kernels::LawDescription& law,
                                  OpenWorldCase c, double noise, std::uint64_t seed);

}  // namespace uniphy
