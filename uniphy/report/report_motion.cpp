#include "uniphy/report/report_motion.hpp"

#include <algorithm>
#include <cmath>

namespace uniphy {
namespace {

/// Keeps the frames 0, 2, 4, … of values [frames, width].
void keep_every_second(std::vector<float>& values, std::size_t width) {
  if (values.empty()) return;
  const std::size_t frames = values.size() / width;
  for (std::size_t f = 2; f < frames; f += 2) {
    const auto from = values.begin() + static_cast<std::ptrdiff_t>(f * width);
    std::copy_n(from, width, values.begin() + static_cast<std::ptrdiff_t>(f / 2 * width));
  }
  values.resize((frames + 1) / 2 * width);
}

/// Values [particles, width] of every `stride`-th particle.
template <class T>
std::vector<T> every(const T* values, std::int64_t particles, std::int64_t stride, int width) {
  std::vector<T> out;
  out.reserve(static_cast<std::size_t>(particles * width));
  for (std::int64_t p = 0; p < particles; ++p) {
    const T* from = values + p * stride * width;
    out.insert(out.end(), from, from + width);
  }
  return out;
}

Motion record(MotionRecorder recorder, const Trajectory& t, const Trajectory* reference,
              const std::string& reference_name) {
  for (std::int64_t f = 0; f < t.frames; ++f) {
    recorder.add(t.time[static_cast<std::size_t>(f)], t.positions(f),
                 t.F.empty() ? nullptr : t.F.data() + f * t.particles * 9,
                 reference ? reference->positions(f) : nullptr);
  }
  return recorder.finish(reference ? reference_name : "");
}

}  // namespace

MotionRecorder::MotionRecorder(std::string name, const std::vector<std::int32_t>& body,
                               std::int64_t maximum_particles,
                               std::int64_t maximum_particle_frames) {
  const auto particles = static_cast<std::int64_t>(body.size());
  motion_.name = std::move(name);
  motion_.particle_stride =
      std::max<std::int64_t>(1, (particles + maximum_particles - 1) / maximum_particles);
  motion_.particles = (particles + motion_.particle_stride - 1) / motion_.particle_stride;
  motion_.body = every(body.data(), motion_.particles, motion_.particle_stride, 1);
  maximum_frames_ = std::max<std::int64_t>(
      2, maximum_particle_frames / std::max<std::int64_t>(1, motion_.particles));
}

void MotionRecorder::add(double time, const double* x, const double* F, const double* reference) {
  if (seen_++ % motion_.frame_stride != 0) return;
  if (motion_.frames() == maximum_frames_) {
    thin_out();
    if ((seen_ - 1) % motion_.frame_stride != 0) return;
  }
  const std::int64_t n = motion_.particles, stride = motion_.particle_stride;
  const std::vector<double> kept = every(x, n, stride, 3);
  motion_.time.push_back(time);
  motion_.x.insert(motion_.x.end(), kept.begin(), kept.end());
  if (F != nullptr) {
    const std::vector<double> gradients = every(F, n, stride, 9);
    if (!strain_) strain_ = std::make_unique<PlasticStrain>(kept, gradients, motion_.body);
    const std::vector<float> strain = strain_->at(kept, gradients);
    motion_.plastic_strain.insert(motion_.plastic_strain.end(), strain.begin(), strain.end());
  }
  if (reference == nullptr) return;
  for (std::int64_t p = 0; p < n; ++p) {
    double sum = 0;
    for (std::int64_t k = 3 * p * stride; k < 3 * p * stride + 3; ++k) {
      sum += (x[k] - reference[k]) * (x[k] - reference[k]);
    }
    motion_.error.push_back(static_cast<float>(std::sqrt(sum)));
  }
}

void MotionRecorder::thin_out() {
  const auto n = static_cast<std::size_t>(motion_.particles);
  keep_every_second(motion_.x, 3 * n);
  keep_every_second(motion_.plastic_strain, n);
  keep_every_second(motion_.error, n);
  std::vector<double>& time = motion_.time;
  for (std::size_t f = 2; f < time.size(); f += 2) time[f / 2] = time[f];
  time.resize((time.size() + 1) / 2);
  motion_.frame_stride *= 2;
}

Motion MotionRecorder::finish(const std::string& reference) {
  motion_.reference = reference;
  return std::move(motion_);
}

Motion motion_of(const std::string& name, const Trajectory& trajectory) {
  return record({name, trajectory.body}, trajectory, nullptr, "");
}

Motion motion_of(const std::string& name, const Trajectory& trajectory,
                 const std::string& reference_name, const Trajectory& reference) {
  const bool same =
      trajectory.frames == reference.frames && trajectory.particles == reference.particles;
  return record({name, trajectory.body}, trajectory, same ? &reference : nullptr, reference_name);
}

Motion motion_of(const std::string& name, const Observation& observation) {
  MotionRecorder recorder(
      name, std::vector<std::int32_t>(static_cast<std::size_t>(observation.points())));
  for (std::int64_t f = 0; f < observation.frames; ++f) {
    recorder.add(observation.time[static_cast<std::size_t>(f)], observation.positions(f), nullptr,
                 nullptr);
  }
  Motion motion = recorder.finish();
  motion.cloud = observation.cloud > 0;
  return motion;
}

}  // namespace uniphy
