#include "uniphy/io/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& message) {
  throw Error(fmt::format("{}: {}", file.string(), message));
}

/// fsync of a file or directory; false with errno set where it fails.
bool sync_path(const std::filesystem::path& path, int flags) {
  const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool good = ::fsync(descriptor) == 0;
  const int error = errno;
  ::close(descriptor);
  errno = error;
  return good;
}

}  // namespace

std::filesystem::path temporary_name(const std::filesystem::path& file) {
  return file.string() + ".tmp";
}

void replace_atomically(const std::filesystem::path& temporary, const std::filesystem::path& file) {
  if (!sync_path(temporary, O_RDONLY)) {
    fail(file, fmt::format("cannot be written to the disk: {}", std::strerror(errno)));
  }
  std::error_code error;
  std::filesystem::rename(temporary, file, error);
  if (error) fail(file, fmt::format("cannot be replaced: {}", error.message()));
  const auto directory = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  // The rename itself has to reach the disk too; file systems that cannot sync a directory do it
  // on their own.
  sync_path(directory, O_RDONLY | O_DIRECTORY);
}

void write_text_file(const std::filesystem::path& file, const std::string& text) {
  const auto temporary = temporary_name(file);
  {
    errno = 0;
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) {
      const std::string reason = errno ? std::strerror(errno) : "unknown error";
      std::error_code ignored;
      std::filesystem::remove(temporary, ignored);
      fail(file, fmt::format("cannot be written: {}", reason));
    }
  }
  replace_atomically(temporary, file);
}

std::string read_text_file(const std::filesystem::path& file, std::size_t maximum_bytes) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) fail(file, "expected a file, found nothing of that name");
  if (std::filesystem::is_directory(status)) fail(file, "expected a file, found a directory");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) fail(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  // Read rather than ask for the size: pipes and /proc have none.
  std::string text;
  char buffer[1 << 16];
  while (stream.read(buffer, sizeof buffer) || stream.gcount() > 0) {
    text.append(buffer, static_cast<std::size_t>(stream.gcount()));
    if (text.size() > maximum_bytes) {
      fail(file, fmt::format("expected at most {} bytes, found more", maximum_bytes));
    }
  }
  if (stream.bad()) fail(file, "cannot be read to its end");
  return text;
}

void make_directory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (std::filesystem::is_directory(directory)) {
    if (::access(directory.c_str(), W_OK) != 0) {
      fail(directory, "expected a directory that can be written to, found one that cannot");
    }
    return;
  }
  if (std::filesystem::exists(directory)) {
    fail(directory, "expected a directory, found a file of that name");
  }
  fail(directory, fmt::format("cannot be made: {}", error.message()));
}

}  // namespace uniphy
