#include <fmt/format.h>
#include <zlib.h>

#include "ops/kernels/base/error.hpp"
#include "uniphy/report/report_codec.hpp"

namespace uniphy {

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string out(size, '\0');
  const int code =
      compress2(reinterpret_cast<Bytef*>(out.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()), 6);
  if (code != Z_OK) throw Error(fmt::format("report: zlib could not compress ({})", code));
  out.resize(size);
  return out;
}

std::string inflated(const std::string& bytes) {
  std::string out(4 * bytes.size() + 1024, '\0');
  while (true) {
    auto size = static_cast<uLongf>(out.size());
    const int code =
        uncompress(reinterpret_cast<Bytef*>(out.data()), &size,
                   reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()));
    if (code == Z_BUF_ERROR && out.size() < (std::size_t{1} << 32)) {
      out.resize(2 * out.size());
      continue;
    }
    if (code != Z_OK) throw Error(fmt::format("report: zlib could not decompress ({})", code));
    out.resize(size);
    return out;
  }
}

std::string base64(const std::string& bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const unsigned byte = i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u;
      group = group << 8 | byte;
    }
    for (int k = 0; k < 4; ++k) out += kDigits[group >> (18 - 6 * k) & 63u];
  }
  if (bytes.size() % 3 != 0)
    out.replace(out.size() - (3 - bytes.size() % 3), 3, "==", 3 - bytes.size() % 3);
  return out;
}

}  // namespace uniphy
