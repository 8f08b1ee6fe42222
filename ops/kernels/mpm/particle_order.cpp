#include "ops/kernels/mpm/particle_order.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::kernels {
namespace {

struct Item {
  std::uint64_t key;
  std::int32_t particle;
};

/// Stable sort by key, 11 bits at a time: the 2048 counters of a pass stay in the first-level
/// cache, and two passes serve grids of up to 161 nodes a side.
void radix_sort(std::vector<Item>& items, std::vector<Item>& spare, std::uint64_t largest_key) {
  constexpr int kBits = 11;
  spare.resize(items.size());
  for (int shift = 0; shift == 0 || (largest_key >> shift) != 0; shift += kBits) {
    std::array<std::size_t, 1 << kBits> start{};
    const auto digit = [&](const Item& item) { return (item.key >> shift) & ((1 << kBits) - 1); };
    for (const Item& item : items) ++start[digit(item)];
    std::size_t sum = 0;
    for (std::size_t& s : start) sum += std::exchange(s, sum);
    for (const Item& item : items) spare[start[digit(item)]++] = item;
    items.swap(spare);
  }
}

/// Base node along one axis; positions outside the grid or not finite go to the border (they are
/// reported where the stencil is computed).
template <class T>
std::uint64_t base_index(T x, int n) {
  const T shifted = x * T(n) - T(0.5);
  if (!(shifted > 0)) return 0;
  return shifted < T(n) ? static_cast<std::uint64_t>(shifted) : static_cast<std::uint64_t>(n - 1);
}

}  // namespace

ParticleOrder::ParticleOrder(std::vector<ParticleRange> bodies) : bodies_(std::move(bodies)) {
  std::ptrdiff_t next = 0;
  for (const auto& [begin, end] : bodies_) {
    if (begin != next || end <= begin) {
      throw Error("body " + std::to_string(first_chunk_.size()) + ": expected particles from " +
                  std::to_string(next) + " on, found the range [" + std::to_string(begin) + ", " +
                  std::to_string(end) + ")");
    }
    first_chunk_.push_back(chunks());
    for (std::ptrdiff_t p = begin; p < end; p += kChunk) {
      body_of_chunk_.push_back(static_cast<int>(first_chunk_.size()) - 1);
      count_.push_back(static_cast<int>(std::min<std::ptrdiff_t>(kChunk, end - p)));
      for (std::ptrdiff_t l = 0; l < kChunk; ++l) {
        slot_.push_back(static_cast<std::int32_t>(std::min(p + l, end - 1)));
      }
    }
    next = end;
  }
  first_chunk_.push_back(chunks());
  particles_ = next;
  if (particles_ == 0) throw Error("a simulation needs at least one particle, found none");
  if (particles_ > std::numeric_limits<std::int32_t>::max() / 2) {
    throw Error("expected fewer than 2^30 particles, found " + std::to_string(particles_));
  }
}

template <class T>
void ParticleOrder::sort(const T* x, int n) {
  std::vector<Item> items, spare;
  const std::uint64_t side = n;
  for (int b = 0; b < bodies(); ++b) {
    const auto [begin, end] = bodies_[b];
    items.clear();
    for (std::ptrdiff_t p = begin; p < end; ++p) {
      const std::uint64_t key =
          (base_index(x[3 * p], n) * side + base_index(x[3 * p + 1], n)) * side +
          base_index(x[3 * p + 2], n);
      items.push_back({key, static_cast<std::int32_t>(p)});
    }
    radix_sort(items, spare, side * side * side);
    std::int32_t* slot = &slot_[first_chunk_[b] * kLawChunk];
    std::int32_t* const slot_end = slot_.data() + first_chunk_[b + 1] * kLawChunk;
    for (const Item& item : items) *slot++ = item.particle;
    std::fill(slot, slot_end, items.back().particle);
  }
}

template <class T>
void ParticleOrder::load(const T* rows, int width, T* planes, std::ptrdiff_t chunk_stride) const {
#pragma omp parallel for schedule(static) if (chunks() >= 64)
  for (int c = 0; c < chunks(); ++c) {
    const std::int32_t* from = particles_of(c);
    T* to = planes + c * chunk_stride;
    for (int l = 0; l < kChunk; ++l) {
      const T* row = rows + std::ptrdiff_t(from[l]) * width;
      for (int k = 0; k < width; ++k) to[k * kChunk + l] = row[k];
    }
  }
}

template <class T>
void ParticleOrder::store(const T* planes, std::ptrdiff_t chunk_stride, int width, T* rows) const {
#pragma omp parallel for schedule(static) if (chunks() >= 64)
  for (int c = 0; c < chunks(); ++c) {
    const std::int32_t* to = particles_of(c);
    const T* from = planes + c * chunk_stride;
    for (int l = 0; l < count(c); ++l) {
      T* row = rows + std::ptrdiff_t(to[l]) * width;
      for (int k = 0; k < width; ++k) row[k] = from[k * kChunk + l];
    }
  }
}

#define UNIPHY_INSTANTIATE(T)                                                    \
  template void ParticleOrder::sort<T>(const T*, int);                           \
  template void ParticleOrder::load<T>(const T*, int, T*, std::ptrdiff_t) const; \
  template void ParticleOrder::store<T>(const T*, std::ptrdiff_t, int, T*) const;
UNIPHY_INSTANTIATE(float)
UNIPHY_INSTANTIATE(double)
#undef UNIPHY_INSTANTIATE

}  // namespace uniphy::kernels
