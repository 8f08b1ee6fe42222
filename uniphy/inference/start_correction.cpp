#include "uniphy/inference/start_correction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

using Eigen::Map;
using Eigen::Vector3d;
using torch::Tensor;

/// The start of a point that the first frame hides.
std::optional<Vector3d> hidden_start(const Observation& o, const ObservedSteps& steps,
                                     const kernels::GridSettings& grid, const RigidMotion& motion,
                                     std::int64_t contact, std::int64_t point) {
  for (std::int64_t f = 1; f < std::min(contact + 1, o.frames); ++f) {
    if (!o.is_seen(f, point)) continue;
    const Vector3d x = flight_pose(steps, grid, motion, f).inverse() *
                       Map<const Vector3d>(o.positions(f) + 3 * point);
    if ((x.array() >= 0).all() && (x.array() <= 1).all()) return x;
    return {};
  }
  return {};
}

}  // namespace

StartCorrection::StartCorrection(const Tensor& flow_gradients, const Tensor& hidden) {
  const std::int64_t frames = flow_gradients.size(0), points = flow_gradients.size(1);
  Tensor G = flow_gradients;
  if (hidden.defined())
    G = G.masked_fill(hidden.slice(0, 0, frames).view({frames, points, 3, 1}), 0);
  G_ = G.permute({1, 0, 2, 3}).reshape({points, 3 * frames, 3}).contiguous();
  // The first frame says something of nearly every point; of one that is never seen, nothing does.
  const Tensor normal = torch::bmm(G_.transpose(1, 2), G_);
  const Tensor eye = torch::eye(3, torch::kFloat64);
  const Tensor trace = normal.diagonal(0, 1, 2).sum(1).view({-1, 1, 1});
  inverse_ = torch::linalg_inv(normal + (1e-9 * trace + 1e-30) * eye);
}

Tensor StartCorrection::correction(const Tensor& r) const {
  const std::int64_t points = G_.size(0), frames = r.size(0);
  const Tensor of_point = r.view({frames, points, 3}).permute({1, 0, 2}).reshape({points, -1, 1});
  return -torch::bmm(inverse_, torch::bmm(G_.transpose(1, 2), of_point)).squeeze(2);
}

Tensor StartCorrection::remaining(const Tensor& r) const {
  const std::int64_t points = G_.size(0), frames = r.size(0);
  const Tensor moved = torch::bmm(G_, correction(r).unsqueeze(2)).view({points, frames, 3});
  return r + moved.permute({1, 0, 2}).reshape({frames, 3 * points});
}

Observation with_corrected_starts(const Observation& observation, const Tensor& delta) {
  Observation o = observation;
  if (!o.tracked()) o.body = o.start();
  std::vector<double>& start = o.tracked() ? o.tracers : o.body;
  const Tensor rows = delta.contiguous();
  for (std::size_t k = 0; k < start.size(); ++k) {
    start[k] = std::clamp(start[k] + rows.data_ptr<double>()[k], 0.0, 1.0);
  }
  return o;
}

Observation with_known_starts(const Observation& observation, const std::string& name) {
  Observation o = observation;
  if (std::none_of(o.tracers.begin(), o.tracers.end(), [](double x) { return std::isnan(x); }))
    return o;
  const ObservedSteps steps = observed_steps(o, name);
  const kernels::GridSettings grid = observed_grid(o, name);
  const RigidMotion motion = observed_motion(o, steps, grid);
  const std::int64_t contact = first_contact(o, steps, grid, motion), points = o.points();
  std::vector<double> tracers;
  std::vector<std::int64_t> kept;
  for (std::int64_t p = 0; p < points; ++p) {
    std::optional<Vector3d> start = Vector3d(Map<const Vector3d>(o.tracers.data() + 3 * p));
    if (start->hasNaN()) start = hidden_start(o, steps, grid, motion, contact, p);
    if (!start) continue;
    kept.push_back(p);
    tracers.insert(tracers.end(), start->data(), start->data() + 3);
  }
  if (kept.empty()) {
    throw Error(fmt::format(
        "{}: /x: expected a point that is seen before the body meets a wall, found none", name));
  }
  std::vector<double> x;
  for (std::int64_t f = 0; f < o.frames; ++f) {
    for (const std::int64_t p : kept) {
      const double* at = o.positions(f) + 3 * p;
      x.insert(x.end(), at, at + 3);
    }
  }
  o.x = std::move(x);
  o.tracers = std::move(tracers);
  return o;
}

}  // namespace uniphy
