#pragma once

#include <array>
#include <optional>
#include <string>

#include "ops/kernels/laws/law.hpp"

namespace uniphy {

/// Where a law comes from, as far as that limits what it is good for.
struct LawOrigin {
  enum class Kind {
    given,    ///< parameters that the user chose
    trained,  ///< a code of a model, or numbers in its space
    fitted    ///< uniphy_infer
  };
  Kind kind = Kind::given;
  std::array<double, 2> dt{};  ///< s, shortest and longest time step of its data; 0: not known
  bool determined = true;      ///< false: the observation that it was fitted to did not show it
};

/// True where the law takes a strain back by a share in each step, so that its rate of flow goes
/// with the time step that its data had. Only the published form of a learned law can: the others
/// know the step. Found by projecting strained states twice: a return at a rate goes on in the
/// second projection, one to a yield surface has arrived. Strains up to 0.2 are looked at; at 0.3
/// caps that training put out of the reach of its elastic samples begin to count.
bool flows_by_steps(const kernels::LawDescription& law);

/// The factor by which dt (s) is off `range`, ≥ 1; 1 inside of it, or where it is not known.
double step_factor(const std::array<double, 2>& range, double dt);
/// The end of `range` (s) that is nearer to dt.
double nearest_step(const std::array<double, 2>& range, double dt);

/// What a time step of `dt` (s) does to a law of this origin, a sentence without the name of the
/// body; nothing where it is as the law's own, within kStepOfFlow or kStepOfFit.
std::optional<std::string> time_step_warning(const kernels::LawDescription& law,
                                             const LawOrigin& origin, double dt);

/// A law that flows_by_steps: its viscosity goes with the step, and a tenth is what the worst codes
/// of held-out materials are off themselves.
inline constexpr double kStepOfFlow = 1.1;
/// Any fitted law: the transfer between particles and grid damps at every step. The rebound of an
/// elastic cube is 0.514, 0.496, 0.476, 0.459 m at 4e-4, 2e-4, 1e-4, 5e-5 s (README): a halving is
/// worth up to 4 %, and more than one is seen.
inline constexpr double kStepOfFit = 2.0;

}  // namespace uniphy
