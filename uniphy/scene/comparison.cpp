#include "uniphy/scene/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

double largest_side(const Trajectory& trajectory) {
  const double* x = trajectory.positions(0);
  double largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double low = x[axis], high = x[axis];
    for (std::int64_t p = 0; p < trajectory.particles; ++p) {
      low = std::min(low, x[3 * p + axis]);
      high = std::max(high, x[3 * p + axis]);
    }
    largest = std::max(largest, high - low);
  }
  return largest;
}

// Pairs (frame of a, frame of b) with the same time.
std::vector<std::pair<std::int64_t, std::int64_t>> pair_frames(const Trajectory& a,
                                                               const Trajectory& b) {
  const auto interval = [](const Trajectory& t) {
    return t.frames > 1 ? (t.time.back() - t.time.front()) / static_cast<double>(t.frames - 1)
                        : 1e-3;
  };
  const double tolerance = 1e-6 * std::min(interval(a), interval(b));
  std::vector<std::pair<std::int64_t, std::int64_t>> pairs;
  for (std::int64_t i = 0, j = 0; i < a.frames && j < b.frames;) {
    const double difference = a.time[i] - b.time[j];
    if (std::abs(difference) <= tolerance)
      pairs.emplace_back(i++, j++);
    else if (difference < 0)
      ++i;
    else
      ++j;
  }
  return pairs;
}

void check_complete(const Trajectory& trajectory, const std::string& name) {
  if (trajectory.failure.empty()) return;
  throw Error(fmt::format(
      "{}: expected a complete trajectory, found one that ends at {:.6g} s because its run failed "
      "({}); frames: common compares the frames that it has",
      name, trajectory.frames > 0 ? trajectory.time.back() : 0.0, trajectory.failure));
}

}  // namespace

TrajectoryComparison compare_trajectories(const Trajectory& predicted, const Trajectory& reference,
                                          FrameMatch match, const std::string& predicted_name,
                                          const std::string& reference_name) {
  if (predicted.particles != reference.particles) {
    throw Error(fmt::format("{}: expected {} particles, as {} has, found {}", predicted_name,
                            reference.particles, reference_name, predicted.particles));
  }
  if (reference.particles == 0) throw Error(reference_name + ": expected particles, found none");
  if (match == FrameMatch::all) {
    check_complete(predicted, predicted_name);
    check_complete(reference, reference_name);
  }
  const auto pairs = pair_frames(predicted, reference);
  const auto matched = static_cast<std::int64_t>(pairs.size());
  if (match == FrameMatch::all && (matched != predicted.frames || matched != reference.frames)) {
    throw Error(fmt::format(
        "{}: expected the {} times of {} (up to {:.6g} s), found {} (up to {:.6g} s), of which {} "
        "agree; frames: common compares those",
        predicted_name, reference.frames, reference_name,
        reference.frames > 0 ? reference.time.back() : 0.0, predicted.frames,
        predicted.frames > 0 ? predicted.time.back() : 0.0, matched));
  }
  if (matched == 0) {
    throw Error(fmt::format("{}: has no time in common with {}", predicted_name, reference_name));
  }

  TrajectoryComparison result;
  result.size = largest_side(reference);
  const std::int64_t bodies =
      reference.body.empty() ? 1
                             : 1 + *std::max_element(reference.body.begin(), reference.body.end());
  std::vector<double> body_sum(bodies, 0.0), body_particles(bodies, 0.0);
  for (std::int64_t p = 0; p < reference.particles; ++p) {
    body_particles[reference.body.empty() ? 0 : reference.body[p]] += 1;
  }
  const double numbers = 3.0 * static_cast<double>(reference.particles);
  for (const auto& [i, j] : pairs) {
    const double* x = predicted.positions(i);
    const double* y = reference.positions(j);
    double sum = 0;
    for (std::int64_t p = 0; p < reference.particles; ++p) {
      double square = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double difference = x[3 * p + axis] - y[3 * p + axis];
        square += difference * difference;
      }
      sum += square;
      body_sum[reference.body.empty() ? 0 : reference.body[p]] += square;
      result.largest_distance = std::max(result.largest_distance, std::sqrt(square));
    }
    result.time.push_back(reference.time[j]);
    result.frame_mse.push_back(sum / numbers);
    result.position_mse += sum / (numbers * static_cast<double>(matched));
  }
  for (std::int64_t b = 0; b < bodies; ++b) {
    result.body_mse.push_back(
        body_particles[b] > 0 ? body_sum[b] / (3 * body_particles[b] * static_cast<double>(matched))
                              : 0.0);
  }
  result.final_mse = result.frame_mse.back();
  result.root_over_size = result.size > 0 ? std::sqrt(result.position_mse) / result.size : 0;
  return result;
}

}  // namespace uniphy
