#include "ops/loss/cloud_residuals.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "ops/base/once_differentiable.hpp"
#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/for_each.hpp"
#include "ops/kernels/loss/nearest_points.hpp"
#include "ops/kernels/loss/transport.hpp"

namespace uniphy::ops {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

constexpr const char* kOp = "cloud_residuals";

/// Three planes of padded numbers, and log₂ of weights.
struct Planes {
  std::vector<double> x, log_weights;
  std::int64_t count = 0;

  explicit Planes(std::int64_t count)
      : x(3 * kernels::padded_columns(count)),
        log_weights(kernels::padded_columns(count), kernels::kNoWeight),
        count(count) {}
  std::int64_t padded() const { return static_cast<std::int64_t>(log_weights.size()); }
};
/// to[k, p] = from[p, k] − origin[k]
void to_planes(const double* from, std::int64_t count, std::int64_t padded, const double* origin,
               double* to) {
  for (std::int64_t p = 0; p < count; ++p)
    for (int k = 0; k < 3; ++k) to[k * padded + p] = from[3 * p + k] - origin[k];
}

/// The points of one frame.
struct Cloud {
  std::vector<std::int64_t> rows;  ///< of the padded tensor
  std::vector<double> x;           ///< [points, 3] m
  std::array<double, 3> low{}, high{};

  std::int64_t points() const { return static_cast<std::int64_t>(rows.size()); }
  std::array<double, 3> centre() const {
    return {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2};
  }
  double diagonal() const {
    return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  }
};

std::string place(std::int64_t frame, std::int64_t row) {
  return " in row " + std::to_string(row) + " of frame " + std::to_string(frame);
}

Cloud read_cloud(const double* x, std::int64_t frame, std::int64_t rows) {
  Cloud cloud;
  for (std::int64_t m = 0; m < rows; ++m, x += 3) {
    if (std::isnan(x[0]) && std::isnan(x[1]) && std::isnan(x[2])) continue;
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(x[k]))
        throw Error(std::string(kOp) + ": clouds: expected three finite coordinates, or three NaN" +
                    ", found " + std::to_string(x[k]) + place(frame, m));
      cloud.low[k] = cloud.rows.empty() ? x[k] : std::min(cloud.low[k], x[k]);
      cloud.high[k] = cloud.rows.empty() ? x[k] : std::max(cloud.high[k], x[k]);
    }
    cloud.rows.push_back(m);
    cloud.x.insert(cloud.x.end(), x, x + 3);
  }
  return cloud;
}

std::vector<double> normalised(const Tensor& weights) {
  const double* w = weights.data_ptr<double>();
  std::vector<double> result(w, w + weights.numel());
  double sum = 0;
  for (std::size_t p = 0; p < result.size(); ++p) {
    if (!(std::isfinite(w[p]) && w[p] > 0))
      throw Error(std::string(kOp) + ": weights: expected finite numbers > 0, found " +
                  std::to_string(w[p]) + " of particle " + std::to_string(p));
    sum += w[p];
  }
  for (double& weight : result) weight /= sum;
  return result;
}

void check_settings(const CloudSettings& s) {
  if (s.distance != CloudDistance::transport) return;
  if (!(std::isfinite(s.blur) && s.blur > 0))
    throw Error(std::string(kOp) + ": blur: expected a length > 0 m, found " +
                std::to_string(s.blur));
  if (s.iterations < 1)
    throw Error(std::string(kOp) + ": iterations: expected at least 1, found " +
                std::to_string(s.iterations));
}

}  // namespace

struct CloudTargets::State {
  CloudSettings settings;
  std::int64_t rows = 0;        ///< M
  std::vector<double> weights;  ///< [P], sum 1
  std::vector<Cloud> clouds;
  std::vector<kernels::NearestPoints> trees;  ///< of each cloud; chamfer
  std::vector<Planes> planes;                 ///< of each cloud, its centre the origin; transport
  std::vector<double> schedule;               ///< transport

  std::int64_t particles() const { return static_cast<std::int64_t>(weights.size()); }
  std::int64_t width() const {
    const std::int64_t of_cloud = 3 * rows, of_particles = 3 * particles();
    if (settings.distance == CloudDistance::transport) return of_particles;
    return settings.distance == CloudDistance::chamfer ? of_cloud + of_particles : of_cloud;
  }
};

namespace {

using State = CloudTargets::State;

Planes cloud_planes(const Cloud& cloud) {
  Planes planes(cloud.points());
  to_planes(cloud.x.data(), planes.count, planes.padded(), cloud.centre().data(), planes.x.data());
  std::fill_n(planes.log_weights.begin(), planes.count,
              -std::log2(static_cast<double>(planes.count)));
  return planes;
}

/// The clouds of all frames with what the distance asks for.
void read_clouds(const Tensor& x, State& s) {
  const CloudDistance distance = s.settings.distance;
  double extent = 0;
  std::int64_t points = 0;
  for (std::int64_t f = 0; f < x.size(0); ++f) {
    s.clouds.push_back(read_cloud(x.data_ptr<double>() + 3 * f * s.rows, f, s.rows));
    const Cloud& cloud = s.clouds.back();
    points += cloud.points();
    extent = std::max(extent, cloud.diagonal());
    if (distance == CloudDistance::chamfer) s.trees.emplace_back(cloud.x.data(), cloud.points());
    if (distance == CloudDistance::transport) s.planes.push_back(cloud_planes(cloud));
  }
  if (points == 0)
    throw Error(std::string(kOp) +
                ": clouds: expected a point in at least one frame, found NaN alone");
  if (distance == CloudDistance::transport)
    s.schedule = kernels::transport_schedule(extent, s.settings.blur, s.settings.iterations);
}

/// What the backward pass of a frame needs: the nearest particles [M] and points [P], or what
/// transport keeps.
struct FrameMemory {
  bool finite = true;
  std::vector<std::int64_t> particle_of, point_of;
  std::vector<double> history;
};

/// The targets and the frames of one forward pass, in the autograd context.
struct Recording : torch::CustomClassHolder {
  std::shared_ptr<const State> targets;
  std::vector<FrameMemory> frames;
};

bool all_finite(const double* x, std::int64_t numbers) {
  return std::all_of(x, x + numbers, [](double v) { return std::isfinite(v); });
}

/// Half of the square of each side of chamfer.
double side(const State& s) { return s.settings.distance == CloudDistance::chamfer ? 0.5 : 1; }
double point_factor(const State& s, const Cloud& cloud) {
  return std::sqrt(side(s) / static_cast<double>(cloud.points()));
}

void nearest_forward(const State& s, std::int64_t frame, const double* x, FrameMemory& memory,
                     double* r) {
  const Cloud& cloud = s.clouds[frame];
  const kernels::NearestPoints particles(x, s.weights.size());
  const double factor = point_factor(s, cloud);
  for (std::int64_t m = 0; m < cloud.points(); ++m) {
    const double* y = &cloud.x[3 * m];
    const std::int64_t p = particles.nearest(y);
    memory.particle_of.push_back(p);
    for (int k = 0; k < 3; ++k) r[3 * cloud.rows[m] + k] = factor * (x[3 * p + k] - y[k]);
  }
  if (s.settings.distance != CloudDistance::chamfer) return;
  r += 3 * s.rows;
  for (std::int64_t p = 0; p < s.particles(); ++p) {
    const std::int64_t m = s.trees[frame].nearest(x + 3 * p);
    const double weight = std::sqrt(side(s) * s.weights[p]);
    for (int k = 0; k < 3; ++k) r[3 * p + k] = weight * (x[3 * p + k] - cloud.x[3 * m + k]);
  }
}

void nearest_adjoint(const State& s, std::int64_t frame, const FrameMemory& memory,
                     const double* grad_r, double* grad_x) {
  const Cloud& cloud = s.clouds[frame];
  const double factor = point_factor(s, cloud);
  for (std::int64_t m = 0; m < cloud.points(); ++m)
    for (int k = 0; k < 3; ++k)
      grad_x[3 * memory.particle_of[m] + k] += factor * grad_r[3 * cloud.rows[m] + k];
  if (s.settings.distance != CloudDistance::chamfer) return;
  grad_r += 3 * s.rows;
  for (std::int64_t p = 0; p < s.particles(); ++p)
    for (int k = 0; k < 3; ++k)
      grad_x[3 * p + k] += std::sqrt(side(s) * s.weights[p]) * grad_r[3 * p + k];
}

Planes particle_planes(const State& s, std::int64_t frame, const double* x) {
  Planes planes(s.particles());
  to_planes(x, planes.count, planes.padded(), s.clouds[frame].centre().data(), planes.x.data());
  for (std::int64_t p = 0; p < planes.count; ++p) planes.log_weights[p] = std::log2(s.weights[p]);
  return planes;
}
kernels::TransportProblem problem_of(const State& s, std::int64_t frame, const Planes& particles) {
  const auto borrowed = [](const Planes& p) {
    return kernels::WeightedPoints{p.x.data(), p.log_weights.data(), p.count, p.padded()};
  };
  return {borrowed(particles), borrowed(s.planes[frame]), &s.schedule};
}

void transport_forward(const State& s, std::int64_t frame, const double* x, FrameMemory& memory,
                       double* r) {
  const Planes particles = particle_planes(s, frame, x);
  const std::int64_t padded = particles.padded();
  memory.history.resize(
      kernels::transport_history_size(s.schedule.size(), padded, s.planes[frame].padded()));
  std::vector<double> displacement(3 * padded);
  kernels::transport_displacement(problem_of(s, frame, particles), memory.history.data(),
                                  displacement.data());
  for (std::int64_t p = 0; p < s.particles(); ++p)
    for (int k = 0; k < 3; ++k)
      r[3 * p + k] = std::sqrt(s.weights[p]) * displacement[k * padded + p];
}

void transport_adjoint(const State& s, std::int64_t frame, const double* x,
                       const FrameMemory& memory, const double* grad_r, double* grad_x) {
  const Planes particles = particle_planes(s, frame, x);
  const std::int64_t padded = particles.padded();
  std::vector<double> grad_displacement(3 * padded), grad_planes(3 * padded);
  for (std::int64_t p = 0; p < s.particles(); ++p)
    for (int k = 0; k < 3; ++k)
      grad_displacement[k * padded + p] = std::sqrt(s.weights[p]) * grad_r[3 * p + k];
  kernels::transport_displacement_adjoint(problem_of(s, frame, particles), memory.history.data(),
                                          grad_displacement.data(), grad_planes.data());
  for (std::int64_t p = 0; p < s.particles(); ++p)
    for (int k = 0; k < 3; ++k) grad_x[3 * p + k] = grad_planes[k * padded + p];
}

/// x, gradients and residuals of one frame after the other.
template <class Visit>
void for_each_frame(const State& s, const Tensor& x, const Visit& visit) {
  const std::int64_t numbers = 3 * s.particles();
  const double* data = x.data_ptr<double>();
  kernels::for_each(x.size(0), [&](std::ptrdiff_t frame) {
    if (s.clouds[frame].points() > 0) visit(frame, data + frame * numbers);
  });
}

class CloudResidualsFunction : public torch::autograd::Function<CloudResidualsFunction> {
 public:
  static Tensor forward(AutogradContext* ctx, const Tensor& x,
                        const c10::intrusive_ptr<Recording>& recording) {
    const State& s = *recording->targets;
    const bool keep = x.requires_grad();
    const std::int64_t numbers = 3 * s.particles(), width = s.width();
    const Tensor residuals = torch::zeros({x.size(0), width}, x.options());
    double* to = residuals.data_ptr<double>();
    recording->frames.resize(x.size(0));
    for_each_frame(s, x, [&](std::int64_t frame, const double* at) {
      FrameMemory memory;
      double* r = to + frame * width;
      memory.finite = all_finite(at, numbers);
      if (!memory.finite) {
        std::fill_n(r, width, std::nan(""));
      } else if (s.settings.distance == CloudDistance::transport) {
        transport_forward(s, frame, at, memory, r);
      } else {
        nearest_forward(s, frame, at, memory, r);
      }
      if (keep) recording->frames[frame] = std::move(memory);
    });
    ctx->save_for_backward({x});
    ctx->saved_data["recording"] = torch::IValue::make_capsule(recording);
    ctx->set_materialize_grads(false);
    return residuals;
  }

  static variable_list backward(AutogradContext* ctx, variable_list grad) {
    variable_list result(2);
    if (!grad[0].defined()) return result;
    const auto recording =
        c10::static_intrusive_pointer_cast<Recording>(ctx->saved_data["recording"].toCapsule());
    const State& s = *recording->targets;
    const Tensor x = ctx->get_saved_variables()[0], grad_x = torch::zeros_like(x);
    const std::int64_t numbers = 3 * s.particles(), width = s.width();
    const double* from = gradient_data<double>(grad[0]);
    double* to = grad_x.data_ptr<double>();
    for_each_frame(s, x, [&](std::int64_t frame, const double* at) {
      const FrameMemory& memory = recording->frames[frame];
      const double* grad_r = from + frame * width;
      double* g = to + frame * numbers;
      if (!memory.finite) {
        std::fill_n(g, numbers, std::nan(""));
      } else if (s.settings.distance == CloudDistance::transport) {
        transport_adjoint(s, frame, at, memory, grad_r, g);
      } else {
        nearest_adjoint(s, frame, memory, grad_r, g);
      }
    });
    result[0] = grad_x;
    return once_differentiable(kOp, std::move(result));
  }
};

}  // namespace

double default_blur(double volume, std::int64_t particles) {
  return 0.5 * std::cbrt(volume / static_cast<double>(particles));
}

CloudTargets::CloudTargets(const Tensor& clouds, const Tensor& weights,
                           const CloudSettings& settings) {
  check_settings(settings);
  const Tensor x = checked(kOp, "clouds", clouds, torch::kFloat64, {kAnySize, kAnySize, 3});
  const Tensor w = checked(kOp, "weights", weights, torch::kFloat64, {kAnySize});
  if (w.numel() == 0) refuse(kOp, "weights", "at least one particle", w);
  auto state = std::make_shared<State>();
  state->settings = settings;
  state->rows = x.size(1);
  state->weights = normalised(w);
  read_clouds(x, *state);
  state_ = std::move(state);
}

Tensor CloudTargets::residuals(const Tensor& x) const {
  const Tensor particles =
      checked(kOp, "x", x, torch::kFloat64, {kAnySize, state_->particles(), 3});
  if (x.size(0) > frames()) refuse(kOp, "x", "at most " + std::to_string(frames()) + " frames", x);
  auto recording = c10::make_intrusive<Recording>();
  recording->targets = state_;
  return CloudResidualsFunction::apply(particles, recording);
}

std::int64_t CloudTargets::frames() const {
  return static_cast<std::int64_t>(state_->clouds.size());
}
std::int64_t CloudTargets::residuals_per_frame() const { return state_->width(); }

}  // namespace uniphy::ops
