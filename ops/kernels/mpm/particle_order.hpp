#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ops/kernels/mpm/particle_chunk.hpp"

namespace uniphy::kernels {

/// A body: a contiguous range of particles [begin, end).
using ParticleRange = std::pair<std::ptrdiff_t, std::ptrdiff_t>;

/// Where each particle sits in memory: bodies one after the other, each padded to whole chunks, the
/// particles of a body sorted by the cell of their base node (x slowest, z fastest, ties in the
/// original order). Neighbours in space are then neighbours in memory, which is what keeps the
/// transfers in the cache. The order depends on nothing but the positions.
class ParticleOrder {
 public:
  explicit ParticleOrder(std::vector<ParticleRange> bodies);

  /// Sorts by x [particles, 3] (m) on a grid of n nodes a side.
  template <class T>
  void sort(const T* x, int n);

  int chunks() const { return static_cast<int>(count_.size()); }
  std::ptrdiff_t particles() const { return particles_; }
  int bodies() const { return static_cast<int>(bodies_.size()); }
  /// Chunks of a body: [first_chunk(b), first_chunk(b + 1)).
  int first_chunk(int body) const { return first_chunk_[body]; }
  int body(int chunk) const { return body_of_chunk_[chunk]; }
  int count(int chunk) const { return count_[chunk]; }
  /// The original indices of the particles of a chunk.
  const std::int32_t* particles_of(int chunk) const { return &slot_[chunk * kLawChunk]; }

  /// Original order, row-major [particles, width] → planes of the chunk at `planes` (each chunk
  /// `chunk_stride` numbers after the one before), and back. Lanes without a particle repeat the
  /// last one.
  template <class T>
  void load(const T* rows, int width, T* planes, std::ptrdiff_t chunk_stride) const;
  template <class T>
  void store(const T* planes, std::ptrdiff_t chunk_stride, int width, T* rows) const;

 private:
  std::vector<ParticleRange> bodies_;
  std::ptrdiff_t particles_ = 0;
  std::vector<int> first_chunk_, body_of_chunk_, count_;
  std::vector<std::int32_t> slot_;  ///< chunk * kChunk + lane → original index
};

}  // namespace uniphy::kernels
