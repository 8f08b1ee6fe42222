#pragma once

#include <cstddef>
#include <cstdint>

#include "ops/kernels/laws/law.hpp"
#include "ops/kernels/simd/prefetch.hpp"

namespace uniphy::kernels {

/// Particles are kept in chunks of kChunk lanes, each number of the state in a plane of its own, so
/// that laws and the per-particle algebra use whole vectors. A chunk belongs to one body.
inline constexpr int kChunk = static_cast<int>(kLawChunk);

/// Planes of one chunk of the state: position x (m), velocity v (m/s), affine velocity C (1/s),
/// deformation gradient F, matrices row-major; memory of the law, used where some body of a
/// roll-out has one.
enum StatePlane {
  kPlaneX = 0,
  kPlaneV = 3,
  kPlaneC = 6,
  kPlaneF = 15,
  kPlaneMemory = 24,
  kStatePlanes = 25
};

inline constexpr int kStateChunkSize = kStatePlanes * kChunk;
inline constexpr int kMatrixChunkSize = 9 * kChunk;

template <class T>
View<T> plane_view(T* planes) {
  return {planes, 1, kChunk};
}

/// What the transfers between particles and grid need of a chunk, ready to use. With base node b,
/// offset f = x/Δx − b and node b + (i,j,k), a particle gives the node the four numbers
///   w_i(f_x) w_j(f_y) w_k(f_z) (q + i a_x + j a_y + k a_z)
/// where q, a_x, a_y, a_z are the four rows of its record. P2G and the adjoint of G2P are both of
/// this form, which is why they share the scatter.
template <class T>
struct TransferChunk {
  alignas(64) T record[kChunk][16];
  alignas(64) T f[3][kChunk];
  alignas(64) std::int32_t base[3][kChunk];
  std::int32_t base_min[3], base_max[3];  ///< over the particles of the chunk
  std::int32_t count;                     ///< particles, at most kChunk
  std::int32_t bad;                       ///< first lane whose stencil leaves the grid, or −1
};

/// Asks for the offsets and base nodes; the records are asked for where the particles are walked
/// over (p2g.hpp).
template <class T>
void prefetch_stencil(const TransferChunk<T>& chunk) {
  prefetch(chunk.f, sizeof(chunk) - offsetof(TransferChunk<T>, f));
}

}  // namespace uniphy::kernels
