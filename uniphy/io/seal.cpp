#include "uniphy/io/seal.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

std::string seal_of(std::string_view bytes) {
  return "\nuniphy-seal " + kernels::Hash().add(bytes).text() + "\n";
}

}  // namespace

void seal_file(const std::filesystem::path& temporary, const std::filesystem::path& file) {
  const std::string seal =
      seal_of(read_text_file(temporary, std::numeric_limits<std::size_t>::max()));
  errno = 0;
  std::ofstream stream(temporary, std::ios::binary | std::ios::app);
  stream << seal;
  stream.close();
  if (!stream) {
    throw Error(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
  }
}

void check_seal(const std::filesystem::path& file) { read_sealed_file(file); }

void write_sealed_file(const std::filesystem::path& file, const std::string& bytes) {
  write_text_file(file, bytes + seal_of(bytes));
}

std::string read_sealed_file(const std::filesystem::path& file) {
  std::string bytes = read_text_file(file, std::numeric_limits<std::size_t>::max());
  const std::size_t length = seal_of("").size();
  const std::size_t end = bytes.size() < length ? 0 : bytes.size() - length;
  if (std::string_view(bytes).substr(end) != seal_of(std::string_view(bytes).substr(0, end))) {
    throw Error(file.string() +
                ": the file is damaged: its checksum does not fit; remove it to start anew");
  }
  bytes.resize(end);
  return bytes;
}

}  // namespace uniphy
