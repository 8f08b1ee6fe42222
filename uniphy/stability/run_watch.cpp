#include "uniphy/stability/run_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace uniphy::stability {
namespace {

/// J is clamped here by the laws (ops/kernels/laws/clamped_volume.hpp, kMinimumJ).
constexpr double kLeastVolume = 1e-6;

double determinant(const double* F) {
  return F[0] * (F[4] * F[8] - F[5] * F[7]) - F[1] * (F[3] * F[8] - F[5] * F[6]) +
         F[2] * (F[3] * F[7] - F[4] * F[6]);
}

double square(const double* values, int count) {
  double sum = 0;
  for (int k = 0; k < count; ++k) sum += values[k] * values[k];
  return sum;
}

}  // namespace

RunWatch::RunWatch(const PlacedScene& placed) : placed_(placed) {
  const kernels::GridSettings& grid = placed.grid;
  const double low = std::max(grid.bound - 1.0, 0.5) * grid.dx();
  for (int a = 0; a < 3; ++a) floor_[a] = grid.gravity[a] <= 0 ? low : 1 - low;
}

double RunWatch::energy(const ParticleState& state) const {
  const kernels::GridSettings& grid = placed_.grid;
  const double affine = 0.25 * grid.dx() * grid.dx();
  double sum = 0;
  for (std::ptrdiff_t p = 0; p < placed_.particles(); ++p) {
    double each = 0.5 * (square(&state.v[3 * p], 3) + affine * square(&state.C[9 * p], 9));
    for (int a = 0; a < 3; ++a) each -= grid.gravity[a] * (state.x[3 * p + a] - floor_[a]);
    sum += placed_.mass[p] * each;
  }
  return sum;
}

void RunWatch::violate(std::int64_t step, std::int64_t particle, const std::string& cause) {
  if (violated_) return;
  violated_ = true;
  failure_ = {step, particle, cause};
}

bool RunWatch::look(std::int64_t step, const ParticleState& state) {
  std::ptrdiff_t fastest = 0, smallest = 0;
  double top = -1, least = 1e300;
  for (std::ptrdiff_t p = 0; p < placed_.particles(); ++p) {
    const double v2 = square(&state.v[3 * p], 3), volume = determinant(&state.F[9 * p]);
    if (!std::isfinite(v2 + volume + square(&state.x[3 * p], 3) + square(&state.C[9 * p], 9))) {
      violate(step, p, "a number of its state is not finite, and the run went on");
      growth_ = kept_ = least_volume_ = std::numeric_limits<double>::quiet_NaN();
      return false;
    }
    if (v2 > top) {
      top = v2;
      fastest = p;
    }
    if (volume < least) {
      least = volume;
      smallest = p;
    }
  }
  speed_ = std::max(speed_, std::sqrt(top));
  least_volume_ = std::min(least_volume_, least);
  const double now = energy(state);
  if (!begun_) {
    initial_ = now;
    begun_ = true;
  }
  kept_ = now / initial_;
  growth_ = std::max(growth_, kept_ - 1);
  if (!(least > kLeastVolume)) {
    violate(step, smallest,
            fmt::format("det F = {:.3g}: the body has collapsed to where its law clamps det F and "
                        "resists no further, and no error says so",
                        least));
  }
  if (!(growth_ <= kEnergyTolerance)) {
    violate(step, fastest,
            fmt::format(
                "the energy is {:.3g} times what the motion began with, and no error says so; the "
                "fastest particle has {:.3g} m/s",
                kept_, std::sqrt(top)));
  }
  return !violated_;
}

void RunWatch::report(Cell& cell) const {
  cell.set("energy_growth", growth_);
  cell.set("energy_kept", kept_);
  cell.set("least_det_F", least_volume_);
  cell.set("largest_speed", speed_);
  cell.verdict = violated_ ? Verdict::fails : Verdict::holds;
  cell.failure = failure_;
}

}  // namespace uniphy::stability
