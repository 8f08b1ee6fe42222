#include "uniphy/report/gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/plot.hpp"

extern char** environ;  // NOLINT(readability-redundant-declaration)

namespace uniphy {
namespace {

/// Exit code of `gnuplot arguments...` with stderr in `log`, or -1 where it cannot be started.
int spawn_gnuplot(std::vector<std::string> arguments, const std::string& log) {
  arguments.insert(arguments.begin(), "gnuplot");
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  pid_t child = 0;
  const int error = posix_spawnp(&child, "gnuplot", &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return -1;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// "pngcairo" where this gnuplot has it, "png" (libgd) otherwise, "" without a usable gnuplot.
const std::string& terminal() {
  static const std::string name = [] {
    for (const char* candidate : {"pngcairo", "png"}) {
      if (spawn_gnuplot({"-e", fmt::format("set terminal {}", candidate)}, "/dev/null") == 0) {
        return std::string(candidate);
      }
    }
    return std::string();
  }();
  return name;
}

/// Whether the file ends as every PNG does. gnuplot says nothing of a full disk.
bool is_whole_png(const std::filesystem::path& file) {
  static constexpr std::string_view kEnd("\0\0\0\0IEND\xae\x42\x60\x82", 12);
  const std::string bytes = read_text_file(file);
  return bytes.size() > kEnd.size() && bytes.substr(bytes.size() - kEnd.size()) == kEnd;
}

/// Removes the working files of one picture whatever happens.
struct Cleanup {
  std::vector<std::filesystem::path> files;
  ~Cleanup() {
    std::error_code ignored;
    for (const auto& file : files) std::filesystem::remove(file, ignored);
  }
};

}  // namespace

bool gnuplot_available() { return !terminal().empty(); }

bool run_gnuplot(const std::filesystem::path& png, int width, int height,
                 const std::string& script) {
  if (!gnuplot_available()) {
    static bool warned = false;
    if (!warned) {
      std::fprintf(stderr, "warning: %s: not drawn, gnuplot is missing (apt install gnuplot-nox)\n",
                   png.c_str());
    }
    warned = true;
    return false;
  }
  const std::filesystem::path temporary = temporary_name(png);
  const std::filesystem::path source = png.string() + ".gp.tmp";
  const std::filesystem::path log = png.string() + ".log.tmp";
  const Cleanup cleanup{{temporary, source, log}};
  write_text_file(
      source,
      fmt::format("set encoding utf8\n"
                  "set terminal {} size {},{} enhanced {} background rgb 'white'\n"
                  "set output {}\n{}\nset output\n",
                  terminal(), width, height, terminal() == "pngcairo" ? "font 'Sans,11'" : "",
                  gnuplot_text(temporary.string()), script));
  const int code = spawn_gnuplot({source.string()}, log.string());
  std::error_code error;
  if (code != 0 || !std::filesystem::exists(temporary, error)) {
    std::string reason = "unknown error";
    if (std::filesystem::exists(log, error)) {
      // gnuplot prints the line, a caret and then the reason, which is all that helps here.
      std::string text = read_text_file(log);
      while (!text.empty() && text.back() == '\n') text.pop_back();
      if (!text.empty()) reason = text.substr(text.rfind('\n') + 1);
    }
    std::fprintf(stderr, "warning: %s: not drawn, gnuplot says: %s\n", png.c_str(), reason.c_str());
    return false;
  }
  if (!is_whole_png(temporary)) {
    throw Error(
        fmt::format("{}: cannot be written: gnuplot left a picture that is cut off (is the "
                    "disk full?)",
                    png.string()));
  }
  replace_atomically(temporary, png);
  return true;
}

std::string gnuplot_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    // A line break would end the command; a back quote would run a shell command.
    out += c == '\n' || c == '\r' ? ' ' : c == '`' ? '\'' : c;
  }
  return out + '"';
}

unsigned viridis(double value) {
  static constexpr unsigned anchors[] = {0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e,
                                         0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725};
  constexpr int last = static_cast<int>(std::size(anchors)) - 1;
  const double at = std::clamp(std::isfinite(value) ? value : 0.0, 0.0, 1.0) * last;
  const int k = std::min(static_cast<int>(at), last - 1);
  const double f = at - k;
  unsigned colour = 0;
  for (int shift = 16; shift >= 0; shift -= 8) {
    const auto channel = [&](unsigned c) { return static_cast<double>(c >> shift & 0xFFu); };
    const double mixed = (1 - f) * channel(anchors[k]) + f * channel(anchors[k + 1]);
    colour |= static_cast<unsigned>(std::lround(mixed)) << shift;
  }
  return colour;
}

}  // namespace uniphy
