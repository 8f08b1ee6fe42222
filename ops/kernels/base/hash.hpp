#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace uniphy::kernels {

/// The 64-bit FNV-1a hash of bytes (G. Fowler, L. C. Noll, K.-P. Vo), the same on every
/// little-endian platform: whether a file belongs to a run, and whether it came back as it was
/// written. Every single changed bit changes it; it is no defence against an attacker.
class Hash {
 public:
  Hash& add(const void* data, std::size_t bytes) {
    const auto* at = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value_ = (value_ ^ at[i]) * 0x100000001b3ULL;
    return *this;
  }
  Hash& add(std::string_view text) { return add(text.data(), text.size()); }
  template <class T>
  Hash& add(const std::vector<T>& values) {
    static_assert(std::is_arithmetic_v<T>);
    return add(values.data(), values.size() * sizeof(T));
  }

  std::uint64_t value() const { return value_; }
  /// 16 hexadecimal digits.
  std::string text() const {
    char digits[17];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(value_));
    return digits;
  }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

}  // namespace uniphy::kernels
