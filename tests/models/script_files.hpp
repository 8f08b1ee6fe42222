#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>

#include "models/torchscript.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy::models {

/// A directory of its own for each test.
class ScriptFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(info->test_suite_name()) + "." + info->name();
    for (char& c : name)
      if (c == '/') c = '_';
    directory_ = std::filesystem::temp_directory_path() / ("uniphy_" + name);
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::filesystem::path file(const std::string& name) const { return directory_ / name; }

 private:
  std::filesystem::path directory_;
};

/// As uniphy_export writes it.
inline void save_script_law(const std::filesystem::path& file,
                            const kernels::LearnedLawWeights& weights, torch::Dtype dtype,
                            const ScriptCodes& codes = {}) {
  write_text_file(file, script_law_bytes(weights, dtype, codes));
}

/// Three codes of two materials.
inline ScriptCodes some_codes(int latent_size) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  ScriptCodes codes;
  codes.materials = {"elastic", "sand", "elastic"};
  for (int k = 0; k < 3 * latent_size; ++k) codes.z.push_back(0.1 * k - 0.7);
  codes.parameters = {
      {1e5, 2e5, none, none, none}, {3e5, 4e5, none, 0.5, none}, {5e5, 6e5, none, none, none}};
  return codes;
}

}  // namespace uniphy::models
