#include "uniphy/io/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>
#include <utility>

#include "ops/kernels/base/error.hpp"

namespace uniphy {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& message) {
  throw Error(fmt::format("{}: {}", file.string(), message));
}

/// An open file or directory.
class Descriptor {
 public:
  Descriptor(const std::filesystem::path& path, int flags)
      : id_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~Descriptor() {
    if (id_ >= 0) ::close(id_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  // Each returns false with errno set where it fails.
  bool valid() const { return id_ >= 0; }
  bool sync() const { return ::fsync(id_) == 0; }
  bool close() { return ::close(std::exchange(id_, -1)) == 0; }
  bool write(const std::string& text) const {
    for (std::size_t done = 0; done < text.size();) {
      const ssize_t count = ::write(id_, text.data() + done, text.size() - done);
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return false;
      done += static_cast<std::size_t>(count);
    }
    return true;
  }

 private:
  int id_;
};

/// Error with what the system says, after the temporary file is gone.
[[noreturn]] void fail_to_write(const std::filesystem::path& file,
                                const std::filesystem::path& temporary) {
  const std::string reason = std::strerror(errno);
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  fail(file, fmt::format("cannot be written: {}", reason));
}

}  // namespace

std::filesystem::path temporary_name(const std::filesystem::path& file) {
  return file.string() + ".tmp";
}

void replace_atomically(const std::filesystem::path& temporary, const std::filesystem::path& file) {
  Descriptor written(temporary, O_RDONLY);
  if (!written.valid() || !written.sync() || !written.close()) fail_to_write(file, temporary);
  if (::rename(temporary.c_str(), file.c_str()) != 0) fail_to_write(file, temporary);
  const auto directory = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  // The rename itself has to reach the disk too; file systems that cannot sync a directory do it
  // on their own.
  const Descriptor parent(directory, O_RDONLY | O_DIRECTORY);
  if (parent.valid()) parent.sync();
}

void write_text_file(const std::filesystem::path& file, const std::string& text) {
  const auto temporary = temporary_name(file);
  Descriptor stream(temporary, O_WRONLY | O_CREAT | O_TRUNC);
  if (!stream.valid() || !stream.write(text) || !stream.close()) fail_to_write(file, temporary);
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
  std::error_code error, ignored;
  std::filesystem::create_directories(directory, error);
  if (std::filesystem::is_directory(directory, ignored)) {
    if (::access(directory.c_str(), W_OK) != 0) {
      fail(directory, "expected a directory that can be written to, found one that cannot");
    }
    return;
  }
  if (std::filesystem::exists(directory, ignored)) {
    fail(directory, "expected a directory, found a file of that name");
  }
  fail(directory, fmt::format("cannot be made: {}", error.message()));
}

}  // namespace uniphy
