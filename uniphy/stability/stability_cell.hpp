#pragma once

// One cell of the matrix of stressors and methods: what was measured, and what it means.

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace uniphy::stability {

/// How a cell ended. The criteria:
///   holds  gradients (spectral rows): every entry is finite, the largest relative error against
///          the reference is ≤ kGradientTolerance, and at least kDerivativeShare of the states have
///          a derivative at all.
///          roll-outs: every number is finite; the motion keeps within what gravity and walls give
///          (energy growth ≤ kEnergyTolerance, run_watch.hpp); the least det F stays above
///          kMinimumJ = 1e-6, where the laws clamp it and resist no further; and where the row
///          measures more (a drift, an error of the gradient), that is within the row's own limit.
///   stops  it ended with an Error that names what is wrong before any of this was violated in a
///          state that a user could have read.
///   fails  everything else: what is wrong goes on in silence.
enum class Verdict { holds, stops, fails };
const char* verdict_name(Verdict verdict);

/// The goal for gradients in float64; central differences of the forward computation are good to
/// 1e-9 on these inputs, so that a failure is one of the method.
inline constexpr double kGradientTolerance = 1e-5;
/// Differences straddle a kink (a yield surface, the clamp of a singular value) for about one
/// random state in 1e4; a law without a derivative has none on a whole class of states.
inline constexpr double kDerivativeShare = 0.99;

/// What went wrong; −1 where it has no step or no particle.
struct Failure {
  std::int64_t step = -1;
  std::int64_t particle = -1;
  std::string cause;
};

struct Cell {
  std::string stressor, method, setting;
  Verdict verdict = Verdict::fails;
  std::string deciding;  ///< the name of the number that the row is judged by
  std::vector<std::pair<std::string, double>> numbers;
  Failure failure;  ///< of a cell that does not hold

  void set(const std::string& name, double value);
  std::optional<double> find(const std::string& name) const;
  /// The deciding number, NaN where it was not reached.
  double decided() const;
};

/// Everything but NaN and infinities, which JSON has not: they come back as NaN.
std::string cell_to_json(const Cell& cell);
/// Throws Error where the text is no cell.
Cell cell_from_json(const std::string& text);

}  // namespace uniphy::stability
