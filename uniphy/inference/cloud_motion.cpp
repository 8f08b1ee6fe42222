#include "uniphy/inference/cloud_motion.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "ops/base/torch.hpp"
#include "uniphy/inference/cloud_comparison.hpp"
#include "uniphy/inference/difference_jacobian.hpp"
#include "uniphy/inference/levenberg_marquardt.hpp"

namespace uniphy {
namespace {

using Eigen::Map;
using Eigen::Vector3d;
using torch::Tensor;

constexpr std::ptrdiff_t kFirstFrames = 4;  ///< that tell where the body flies at first
constexpr std::int64_t kMostFrames = 12;    ///< that are compared
constexpr int kIterations = 12;
/// Units of the numbers: m/s and rad/s.
constexpr double kLinearUnit = 0.1, kAngularUnit = 0.5;

/// Number of points of a frame and their mean.
std::pair<double, Vector3d> centre_of_cloud(const Observation& o, std::int64_t frame) {
  Vector3d sum = Vector3d::Zero();
  double count = 0;
  for (std::int64_t p = 0; p < o.points(); ++p) {
    if (!o.is_seen(frame, p)) continue;
    sum += Map<const Vector3d>(o.positions(frame) + 3 * p);
    ++count;
  }
  return {count, count > 0 ? Vector3d(sum / count) : sum};
}

/// From the centres of the clouds of frames 1 to `last`, of a body that begins at its own.
Vector3d velocity_of_centres(const Observation& o, const ObservedSteps& steps,
                             const kernels::GridSettings& grid, const RigidMotion& motion,
                             std::ptrdiff_t last) {
  RigidMotion still = motion;
  still.linear.setZero();
  still.angular.setZero();
  Vector3d moment = Vector3d::Zero();
  double weight = 0;
  for (std::ptrdiff_t f = 1; f <= last; ++f) {
    const auto [count, centre] = centre_of_cloud(o, f);
    const double t = o.time[f] - o.time[0];
    const Vector3d fallen = flight_pose(steps, grid, still, f) * motion.centre;
    moment += count * t * (centre - fallen);
    weight += count * t * t;
  }
  return weight > 0 ? Vector3d(moment / weight) : Vector3d::Zero();
}

/// The frames of the flight that are compared, evenly spread over 1 to `last`.
std::vector<std::int64_t> compared_frames(const Observation& o, std::ptrdiff_t last) {
  std::vector<std::int64_t> shown, chosen;
  for (std::int64_t f = 1; f <= last; ++f) {
    if (o.shows_any(f)) shown.push_back(f);
  }
  const auto count = static_cast<std::int64_t>(shown.size()), most = std::min(count, kMostFrames);
  for (std::int64_t k = 1; k <= most; ++k) chosen.push_back(shown[k * count / most - 1]);
  return chosen;
}

/// A rigid flight against some clouds.
class FlightOfCloud {
 public:
  FlightOfCloud(const Observation& o, const ObservedSteps& steps, const kernels::GridSettings& grid,
                const RigidMotion& from, const std::vector<std::int64_t>& frames)
      : steps_(steps),
        grid_(grid),
        from_(from),
        frames_(frames),
        start_(o.start()),
        comparison_(some_frames(o, frames), CloudDetail::rough) {}

  RigidMotion motion(const Tensor& numbers) const {
    RigidMotion m = from_;
    for (int k = 0; k < 3; ++k) {
      m.linear[k] += kLinearUnit * numbers[k].item<double>();
      m.angular[k] += kAngularUnit * numbers[3 + k].item<double>();
    }
    return m;
  }
  /// Of all frames in turn, m, over the root of their number.
  Tensor residuals(const Tensor& numbers) const {
    const RigidMotion m = motion(numbers);
    const auto particles = static_cast<std::int64_t>(start_.size() / 3);
    Tensor x = torch::empty({std::int64_t(frames_.size()), particles, 3}, torch::kFloat64);
    double* to = x.data_ptr<double>();
    for (const std::int64_t f : frames_) {
      const Eigen::Isometry3d pose = flight_pose(steps_, grid_, m, f);
      for (std::size_t k = 0; k < start_.size(); k += 3, to += 3)
        (Map<Vector3d>(to)) = pose * Vector3d(Map<const Vector3d>(start_.data() + k));
    }
    const Tensor r = comparison_.residuals(x).flatten();
    return r / std::sqrt(double(r.numel()));
  }

 private:
  const ObservedSteps& steps_;
  const kernels::GridSettings& grid_;
  RigidMotion from_;
  std::vector<std::int64_t> frames_;
  std::vector<double> start_;
  CloudComparison comparison_;
};

/// The motion that fits the frames best, from another one.
MotionEstimate fitted_flight(const FlightOfCloud& flight, std::size_t frames) {
  const Residuals residuals = [&](const Tensor& u) { return flight.residuals(u); };
  LevenbergMarquardt optimizer({torch::zeros({6}, torch::kFloat64)}, LevenbergMarquardtOptions());
  for (int k = 0; k < kIterations && !optimizer.stuck(); ++k) {
    const double before = optimizer.loss();
    if (!(optimizer.step(residuals).item<double>() < 0.999 * before)) break;
  }
  std::vector<std::int64_t> columns(6);
  std::iota(columns.begin(), columns.end(), std::int64_t{0});
  const Tensor at = optimizer.point(), r = residuals(at);
  const Eigen::MatrixXd J = difference_jacobian(residuals, at, r, columns, 1e-6).J;
  Eigen::MatrixXd A = normal_matrix(J);
  A.diagonal().array() += 1e-9 * A.trace() + 1e-300;
  const Eigen::MatrixXd covariance = A.inverse() * sum_of_squares(r) / double(frames);
  MotionEstimate estimate;
  estimate.motion = InitialState(flight.motion(at));
  for (int k = 0; k < 6; ++k)
    estimate.spread.push_back((k < 3 ? kLinearUnit : kAngularUnit) * std::sqrt(covariance(k, k)));
  return estimate;
}

}  // namespace

MotionEstimate estimate_cloud_motion(const Observation& o, const ObservedSteps& steps,
                                     const kernels::GridSettings& grid) {
  const torch::NoGradGuard no_grad;
  RigidMotion motion;
  motion.centre = centre_of_mass(o);
  const std::ptrdiff_t end = o.frames - 1;
  std::ptrdiff_t last = std::min(kFirstFrames, end);
  for (std::ptrdiff_t before = 0; last > before;) {
    before = last;
    motion.linear = velocity_of_centres(o, steps, grid, motion, last);
    while (last < end && !reaches_wall(o, steps, grid, motion, last + 1)) ++last;
  }
  MotionEstimate estimate;
  estimate.motion = InitialState(motion);
  estimate.spread = {1, 1, 1, 5, 5, 5};  // next to nothing is known
  // A body with symmetries may be turned by too much for the later frames at first.
  for (const std::ptrdiff_t until : {(last + 1) / 2, last}) {
    const std::vector<std::int64_t> frames = compared_frames(o, until);
    if (frames.empty()) continue;
    estimate = fitted_flight(FlightOfCloud(o, steps, grid, estimate.motion, frames), frames.size());
  }
  return estimate;
}

}  // namespace uniphy
