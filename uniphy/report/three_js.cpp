#include <fmt/format.h>

#include <cstdlib>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/report.hpp"

namespace uniphy {
namespace {

std::string read_three_js(const std::filesystem::path& file) {
  std::string text = read_text_file(file);
  // The build for a plain <script>, which defines THREE; a module (three.module.js) does not.
  if (text.find("global.THREE") == std::string::npos || text.find("WebGLRenderer") == text.npos) {
    throw Error(
        fmt::format("{}: expected three.min.js of libjs-three, found another file", file.string()));
  }
  return text;
}

}  // namespace

std::string find_three_js(const std::vector<std::filesystem::path>& files) {
  std::error_code ignored;
  for (const auto& file : files) {
    if (std::filesystem::is_regular_file(file, ignored)) return read_three_js(file);
  }
  throw Error(
      fmt::format("--report: expected three.js at {}, found none: apt install libjs-three, "
                  "set {} to the file three.min.js, or leave the report out (--no-report)",
                  files.empty() ? "" : files.front().string(), kThreeJsVariable));
}

std::string find_three_js() {
  if (const char* file = std::getenv(kThreeJsVariable); file != nullptr && *file != '\0') {
    return find_three_js({file});
  }
  const std::filesystem::path folder = "/usr/share/javascript/three";
  return find_three_js({folder / "three.min.js", folder / "build/three.min.js"});
}

}  // namespace uniphy
