#pragma once

#include <cstddef>

namespace uniphy::kernels {

/// Strided access to `components` numbers of each particle: component k of particle p stands at
/// data[p * particle_stride + k * component_stride]. A row-major tensor [P, 3, 3] is {ptr, 9, 1};
/// planes of length ld (one per component) are {ptr, 1, ld}. A null view reads as absent.
template <class T>
struct View {
  T* data = nullptr;
  std::ptrdiff_t particle_stride = 0;
  std::ptrdiff_t component_stride = 1;

  T& operator()(std::ptrdiff_t p, std::ptrdiff_t k) const {
    return data[p * particle_stride + k * component_stride];
  }
  explicit operator bool() const { return data != nullptr; }
  /// The same view seen from particle `first`.
  View from(std::ptrdiff_t first) const {
    return {data ? data + first * particle_stride : nullptr, particle_stride, component_stride};
  }
  operator View<const T>() const { return {data, particle_stride, component_stride}; }
};

}  // namespace uniphy::kernels
