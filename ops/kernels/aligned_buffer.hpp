#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

namespace uniphy::kernels {

/// Memory aligned for the widest vectors, left uninitialised, so that pages of a large grid that
/// are never touched cost nothing.
template <class T>
class AlignedBuffer {
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(std::ptrdiff_t size) { resize(size); }

  /// Contents are lost; memory is kept where it is large enough.
  void resize(std::ptrdiff_t size) {
    if (size > capacity_) {
      data_.reset();  // first, so that the old and the new block never exist together
      data_.reset(static_cast<T*>(::operator new(size * sizeof(T), kAlignment)));
      capacity_ = size;
    }
    size_ = size;
  }
  void fill(const T& value) {
    for (std::ptrdiff_t i = 0; i < size_; ++i) data_.get()[i] = value;
  }

  std::ptrdiff_t size() const { return size_; }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](std::ptrdiff_t i) { return data_.get()[i]; }
  const T& operator[](std::ptrdiff_t i) const { return data_.get()[i]; }

 private:
  static constexpr std::align_val_t kAlignment{64};
  struct Free {
    void operator()(T* p) const { ::operator delete(p, kAlignment); }
  };
  std::unique_ptr<T, Free> data_;
  std::ptrdiff_t size_ = 0, capacity_ = 0;
};

}  // namespace uniphy::kernels
