#include "uniphy/inference/misfit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "uniphy/inference/cloud_misses.hpp"
#include "uniphy/inference/observed_motion.hpp"
#include "uniphy/inference/observed_noise.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

constexpr int kThirds = 3;
constexpr int kBlocks = kThirds * kThirds * kThirds;

std::vector<double> starts_of(const Observation& seen) {
  return seen.tracked() ? seen.tracers : seen.start();
}

/// The block of every point, x + 3 y + 9 z.
std::vector<int> blocks_of(const Observation& seen) {
  const std::vector<double> x = starts_of(seen);
  std::vector<int> blocks(static_cast<std::size_t>(seen.points()), 0);
  for (int k = 0, weight = 1; k < 3; ++k, weight *= kThirds) {
    double low = x[k], high = x[k];
    for (std::int64_t p = 0; p < seen.points(); ++p) {
      low = std::min(low, x[3 * p + k]);
      high = std::max(high, x[3 * p + k]);
    }
    for (std::int64_t p = 0; p < seen.points(); ++p) {
      const double share = high > low ? (x[3 * p + k] - low) / (high - low) : 0;
      blocks[p] += weight * std::min(kThirds - 1, static_cast<int>(kThirds * share));
    }
  }
  return blocks;
}

void find_block(const Observation& seen, const std::vector<double>& square, Misfit& misfit) {
  const std::vector<int> blocks = blocks_of(seen);
  std::array<double, kBlocks> sum{}, count{};
  for (std::int64_t p = 0; p < seen.points(); ++p) {
    sum[blocks[p]] += square[p];
    ++count[blocks[p]];
  }
  int worst = 0;
  const auto mean = [&](int b) { return count[b] > 0 ? sum[b] / count[b] : 0; };
  for (int b = 1; b < kBlocks; ++b) {
    if (mean(b) > mean(worst)) worst = b;
  }
  misfit.block = {worst % kThirds, worst / kThirds % kThirds, worst / (kThirds * kThirds)};
  misfit.block_root = std::sqrt(mean(worst));
}

Misfit begin_misfit(const Observation& seen, double tolerance, double allowance) {
  Misfit m;
  m.time = seen.time;
  const double noise = allowance * observed_noise(seen) / observed_size(seen);
  m.allowed = std::hypot(tolerance, noise);
  m.allowed_ahead = std::hypot(kForecastAllowance * tolerance, noise);
  return m;
}

void find_growth(Misfit& m) {
  m.grows = static_cast<std::int64_t>(m.root.size());
  while (m.grows > 0 && m.root[m.grows - 1] > m.allowed) --m.grows;
}

}  // namespace

Misfit misfit_of(const Observation& seen, const Trajectory& fitted, double tolerance,
                 bool starts_fitted) {
  const double size = observed_size(seen);
  Misfit m = begin_misfit(seen, tolerance, starts_fitted ? kNoiseAllowance : 2);
  std::vector<double> square(static_cast<std::size_t>(seen.points()), 0);  // of a coordinate
  double all = 0;
  for (std::int64_t f = 0; f < seen.frames; ++f) {
    double sum = 0, largest = 0, count = 0;
    for (std::int64_t p = 0; p < seen.points(); ++p) {
      if (!seen.is_seen(f, p)) continue;
      double distance = 0;
      for (int k = 0; k < 3; ++k) {
        const double d = (fitted.positions(f)[3 * p + k] - seen.positions(f)[3 * p + k]) / size;
        distance += d * d;
      }
      square[p] += distance / (3.0 * double(seen.frames));
      sum += distance;
      count += 3;
      largest = std::max(largest, distance);
    }
    m.root.push_back(count > 0 ? std::sqrt(sum / count) : 0);
    m.largest.push_back(std::sqrt(largest));
    m.over_size += sum;
    all += count;
  }
  m.over_size /= all;
  m.over_size = std::sqrt(m.over_size);
  find_growth(m);
  m.particle = std::max_element(square.begin(), square.end()) - square.begin();
  find_block(seen, square, m);
  return m;
}

Misfit misfit_of_clouds(const Observation& seen, const Trajectory& fitted, double tolerance) {
  Misfit m = begin_misfit(seen, tolerance, 2);
  const double size = observed_size(seen);
  const CloudMisses misses = cloud_misses(seen, fitted.x);
  for (const double root : misses.root) m.root.push_back(root / size);
  for (const double largest : misses.largest) m.largest.push_back(largest / size);
  m.over_size = misses.over_all / size;
  find_growth(m);
  return m;
}

std::string misfit_place(const Misfit& m, const Observation& seen) {
  constexpr const char* kThird[] = {"low", "middle", "high"};
  const auto last = static_cast<std::int64_t>(m.time.size()) - 1;
  const auto peak = std::max_element(m.root.begin(), m.root.end()) - m.root.begin();
  const std::string when =
      m.grows <= last
          ? fmt::format("from {:.3g} s on it stays above that", m.time[m.grows] - m.time[0])
          : fmt::format("it is largest at {:.3g} s", m.time[peak] - m.time[0]);
  if (seen.cloud > 0) return when;
  const std::vector<double> starts = starts_of(seen);
  const double* x = starts.data() + 3 * m.particle;
  return fmt::format(
      "{}; it is largest, {:.2g} %, in the {} third along x, {} along y and {} along z of the body "
      "at the first frame, and of point {}, at ({:.3f}, {:.3f}, {:.3f}) m there",
      when, 100 * m.block_root, kThird[m.block[0]], kThird[m.block[1]], kThird[m.block[2]],
      m.particle, x[0], x[1], x[2]);
}

void write_misfit(const std::filesystem::path& csv, const Misfit& m) {
  std::string text = "time_s,root_over_size,largest_over_size\n";
  for (std::size_t f = 0; f < m.time.size(); ++f) {
    text += fmt::format("{:.9g},{:.9g},{:.9g}\n", m.time[f], m.root[f], m.largest[f]);
  }
  write_text_file(csv, text);
}

Chart misfit_chart(const Misfit& m) {
  Chart chart;
  chart.title = "What the fitted law leaves";
  chart.x_label = "time (s)";
  chart.y_label = "error over size";
  chart.log_y = true;
  const auto line = [&](const std::string& label, const std::vector<double>& y) {
    Series series;
    series.label = label;
    series.x = m.time;
    series.y = y;
    for (double& value : series.y) {
      if (!(value > 0)) value = std::nan("");
    }
    chart.series.push_back(series);
  };
  line("root of the mean square", m.root);
  line("largest particle", m.largest);
  line("noise and tolerance", std::vector<double>(m.time.size(), m.allowed));
  return chart;
}

}  // namespace uniphy
