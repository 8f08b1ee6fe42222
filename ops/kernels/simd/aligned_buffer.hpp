#pragma once

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace uniphy::kernels {

/// Whether a large buffer asks for pages of 2 MiB: where all of it is walked over again and again,
/// as the particles are, misses of the TLB are up to a tenth of the time; where only parts are
/// touched, as of a grid, small pages keep the rest out of memory.
enum class Pages { small, huge };

/// Memory aligned for the widest vectors, left uninitialised, so that pages of a large grid that
/// are never touched cost nothing.
template <class T>
class AlignedBuffer {
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(std::ptrdiff_t size, Pages pages = Pages::small) : pages_(pages) {
    resize(size);
  }

  /// Contents are lost; memory is kept where it is large enough.
  void resize(std::ptrdiff_t size) {
    if (size > capacity_) {
      data_.reset();  // first, so that the old and the new block never exist together
      data_.reset(static_cast<T*>(allocate(size * sizeof(T))));
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
  static constexpr std::size_t kAlignment = 64, kHugePage = std::size_t(1) << 21;

  void* allocate(std::size_t bytes) const {
    const bool huge = pages_ == Pages::huge && bytes >= 2 * kHugePage;
    const std::size_t alignment = huge ? kHugePage : kAlignment;
    bytes = (bytes + alignment - 1) / alignment * alignment;
    void* p = std::aligned_alloc(alignment, bytes);
    if (p == nullptr) throw std::bad_alloc();
#if defined(MADV_HUGEPAGE)
    if (huge) ::madvise(p, bytes, MADV_HUGEPAGE);  // a wish: small pages do, too
#endif
    return p;
  }

  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  Pages pages_ = Pages::small;
  std::unique_ptr<T, Free> data_;
  std::ptrdiff_t size_ = 0, capacity_ = 0;
};

}  // namespace uniphy::kernels
