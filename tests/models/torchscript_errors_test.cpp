// What the loader of an exported law and the law itself refuse.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/script.h>
#include <torch/serialize.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "models/torchscript.hpp"
#include "ops/base/torch.hpp"
#include "tests/models/script_files.hpp"
#include "tests/support/error_of.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::models {
namespace {

namespace fs = std::filesystem;
using kernels::Activation;
using kernels::LawForm;
using ::testing::HasSubstr;
using torch::Tensor;

class ScriptLawErrors : public ScriptFiles {
 protected:
  static kernels::LearnedLawWeights small() {
    return testing::random_weights(LawForm::isotropic, 3, 8, 1, Activation::silu, 1);
  }
  /// Saves a law after `change`, loads it and returns what the loader says.
  std::string after(const std::function<void(torch::jit::Module&)>& change) const {
    torch::jit::Module module = script_law(small(), torch::kFloat64);
    change(module);
    module.save(file("law.pt").string());
    return testing::error_of([this] { load_script_law(file("law.pt")); });
  }
  std::string prefix() const { return file("law.pt").string() + ": "; }
};

TEST_F(ScriptLawErrors, AnUnchangedLawIsAccepted) {
  script_law(small(), torch::kFloat64).save(file("law.pt").string());
  EXPECT_NO_THROW(load_script_law(file("law.pt")));
}

TEST_F(ScriptLawErrors, WrongAttributes) {
  EXPECT_EQ(after([](auto& m) { m.setattr("format", std::string("other")); }),
            prefix() + "attribute format: expected \"uniphy-torchscript-law\", found \"other\"");
  EXPECT_EQ(after([](auto& m) { m.setattr("version", 1); }),
            prefix() + "attribute version: expected 3, found 1; export the model again");
  EXPECT_EQ(after([](auto& m) { m.setattr("units", std::string("tau: kPa")); }),
            prefix() +
                "attribute units: expected \"F: 1, C: 1/s, z: 1, tau: Pa\", found \"tau: "
                "kPa\"");
  EXPECT_EQ(after([](auto& m) { m.setattr("dtype", std::string("float16")); }),
            prefix() + "attribute dtype: expected \"float32\" or \"float64\", found \"float16\"");
  EXPECT_EQ(after([](auto& m) { m.setattr("dtype", std::string("float32")); }),
            prefix() + "buffer projection_weight_0: expected dtype float32, found float64");
  EXPECT_EQ(after([](auto& m) { m.setattr("form", std::string("cubic")); }),
            prefix() + "attribute form: expected \"isotropic\" or \"published\", found \"cubic\"");
  EXPECT_EQ(after([](auto& m) { m.setattr("latent_size", 4); }),
            prefix() +
                "buffer projection_weight_0: expected [n, 7] and a bias of [n], found [8, "
                "6] and a bias of [8]");
  EXPECT_EQ(after([](auto& m) { m.setattr("form", std::string("published")); }),
            prefix() +
                "buffer projection_weight_0: expected [n, 33] and a bias of [n], found [8, "
                "6] and a bias of [8]");
}

TEST_F(ScriptLawErrors, WrongCodes) {
  ScriptCodes short_of_z = some_codes(3);
  short_of_z.z.pop_back();
  EXPECT_EQ(testing::error_of([&] { script_law(small(), torch::kFloat64, short_of_z); }),
            "TorchScript law: codes: expected [3, 3] numbers and parameters of 3 codes, found 8 "
            "and 3");
  EXPECT_EQ(after([](auto& m) {
              m.setattr("codes", torch::zeros({2, 4}, torch::kFloat64));
            }),
            prefix() + "buffer codes: expected [N, 3], found [2, 4]");
  EXPECT_EQ(after([](auto& m) {
              m.setattr("codes", torch::zeros({2, 3}, torch::kFloat64));
            }),
            prefix() + "attribute materials: expected 2 strings, found 0");
  EXPECT_EQ(after([](auto& m) {
              m.setattr("codes", torch::zeros({2, 3}));
            }),
            prefix() + "buffer codes: expected dtype float64, found float32");
  EXPECT_EQ(after([](auto& m) {
              m.setattr("material_parameters", torch::zeros({1, 5}, torch::kFloat64));
            }),
            prefix() + "buffer material_parameters: expected [0, 5], found [1, 5]");
}

TEST_F(ScriptLawErrors, AnotherPrecisionThanAskedFor) {
  save_script_law(file("law.pt"), small(), torch::kFloat64);
  EXPECT_EQ(testing::error_of([this] { load_script_law(file("law.pt"), torch::kFloat32); }),
            prefix() + "attribute dtype: expected \"float32\", found \"float64\"");
}

TEST_F(ScriptLawErrors, AModuleOfAnotherKind) {
  torch::jit::Module module("__torch__.Other");
  module.define("def forward(self, x: Tensor) -> Tensor:\n    return x\n");
  module.save(file("law.pt").string());
  EXPECT_EQ(testing::error_of([this] { load_script_law(file("law.pt")); }),
            prefix() + "attribute format: expected to be there, found none");
}

TEST_F(ScriptLawErrors, ALawWithoutItsMethods) {
  torch::jit::Module whole = script_law(small(), torch::kFloat64);
  torch::jit::Module bare("__torch__.UniphyLaw");
  for (const char* name : {"format", "form", "dtype", "units"})
    bare.register_attribute(name, c10::StringType::get(), whole.attr(name));
  for (const char* name : {"version", "latent_size"})
    bare.register_attribute(name, c10::IntType::get(), whole.attr(name));
  for (const char* name : {"materials", "parameter_names", "parameter_units"})
    bare.register_attribute(name, whole.type()->findAttribute(name), whole.attr(name));
  for (const auto& buffer : whole.named_buffers()) bare.register_buffer(buffer.name, buffer.value);
  bare.define("def project(self, F: Tensor, z: Tensor, dt: float) -> Tensor:\n    return F\n");
  bare.save(file("law.pt").string());
  EXPECT_EQ(testing::error_of([this] { load_script_law(file("law.pt")); }),
            prefix() + "method stress: expected to be there, found none");
}

TEST_F(ScriptLawErrors, FilesThatAreNoLaw) {
  EXPECT_EQ(testing::error_of([this] { load_script_law(file("law.pt")); }),
            prefix() + "expected a TorchScript file, found no such file");
  std::ofstream(file("law.pt")) << "model: isotropic\n";
  EXPECT_EQ(testing::error_of([this] { load_script_law(file("law.pt")); }),
            prefix() +
                "expected a TorchScript file (a zip archive), found something else of 17 "
                "bytes");
  // An archive of tensors is no program.
  torch::save(std::vector<Tensor>{torch::zeros(3)}, file("law.pt").string());
  EXPECT_THAT(testing::error_of([this] { load_script_law(file("law.pt")); }), HasSubstr(prefix()));
}

TEST_F(ScriptLawErrors, TruncatedFiles) {
  save_script_law(file("whole.pt"), small(), torch::kFloat64);
  const auto size = fs::file_size(file("whole.pt"));
  for (const double part : {0.1, 0.5, 0.9, 0.999}) {
    fs::copy_file(file("whole.pt"), file("law.pt"), fs::copy_options::overwrite_existing);
    fs::resize_file(file("law.pt"), std::uintmax_t(double(size) * part));
    EXPECT_THAT(testing::error_of([this] { load_script_law(file("law.pt")); }),
                HasSubstr(prefix() + "expected a whole TorchScript file, found one that LibTorch "
                                     "cannot read, truncated or damaged: "))
        << part;
  }
}

TEST_F(ScriptLawErrors, UnwritableFile) {
  EXPECT_THAT(testing::error_of([this] {
                save_script_law(file("no/such/directory/law.pt"), small(), torch::kFloat64);
              }),
              HasSubstr("law.pt: cannot be written: No such file or directory"));
}

TEST_F(ScriptLawErrors, WrongArgumentsNameThemselves) {
  const auto w = small();
  const ScriptLaw law{script_law(w, torch::kFloat64), w.form, w.latent_size, torch::kFloat64};
  const Tensor F = torch::eye(3).repeat({2, 1, 1});
  const auto message = [](const std::function<void()>& call) -> std::string {
    try {
      call();
    } catch (const std::exception& e) {
      return e.what();
    }
    return "no error";
  };
  EXPECT_THAT(message([&] { law.project(F[0], torch::zeros(3)); }),
              HasSubstr("uniphy law: F: expected [P, 3, 3], found [3, 3]"));
  EXPECT_THAT(message([&] { law.project(F, torch::zeros(4)); }),
              HasSubstr("uniphy law: z: expected [3] or [2, 3], found [4]"));
  EXPECT_THAT(message([&] { law.stress(F, F.slice(0, 1), torch::zeros(3)); }),
              HasSubstr("uniphy law: C: expected [2, 3, 3], found [1, 3, 3]"));
  for (const double dt : {0.0, -1e-4, std::numeric_limits<double>::quiet_NaN(),
                          std::numeric_limits<double>::infinity()})
    EXPECT_THAT(message([&] { law.project(F, torch::zeros(3), dt); }),
                HasSubstr("uniphy law: dt: expected a time step above 0 s, found "));
  // Numbers that are none, or that no answer would fit.
  const Tensor z = torch::zeros(3), nan = F * std::numeric_limits<double>::quiet_NaN();
  const std::string finite = "expected finite numbers, found NaN or infinity";
  const std::string floats = "expected float32 or float64, found ";
  for (const auto& [x, text] :
       {std::pair(nan, finite), std::pair(F / 0, finite),
        std::pair(F.to(torch::kInt64), floats + "integers or truth values of 64 bits"),
        std::pair(F.to(torch::kHalf), floats + "floating-point numbers of 16 bits"),
        std::pair(F.to(torch::kBFloat16), floats + "floating-point numbers of 16 bits"),
        std::pair(F.to(torch::kComplexDouble), floats + "complex numbers of 128 bits")}) {
    EXPECT_THAT(message([&] { law.project(x, z); }), HasSubstr("uniphy law: F: " + text));
    EXPECT_THAT(message([&] { law.stress(x, F, z); }), HasSubstr("uniphy law: F_proj: " + text));
    EXPECT_THAT(message([&] { law.stress(F, x, z); }), HasSubstr("uniphy law: C: " + text));
    const Tensor of_x = x.select(0, 0).select(0, 0);
    EXPECT_THAT(message([&] { law.project(F, of_x); }), HasSubstr("uniphy law: z: " + text));
    EXPECT_THAT(message([&] { law.stress(F, F, of_x); }), HasSubstr("uniphy law: z: " + text));
  }
  // Finite, but not in the law's own precision.
  const ScriptLaw single{script_law(w, torch::kFloat32), w.form, w.latent_size, torch::kFloat32};
  EXPECT_THAT(message([&] { single.project(F.to(torch::kFloat64) * 1e300, z); }),
              HasSubstr("uniphy law: F: " + finite));
}

}  // namespace
}  // namespace uniphy::models
