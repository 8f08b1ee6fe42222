// The exported law against the kernels, and what the loader refuses.

#include "models/torchscript.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <torch/torch.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "models/script_check.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/learned/learned_law.hpp"
#include "tests/support/caps.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::models {
namespace {

namespace fs = std::filesystem;
using kernels::Activation;
using kernels::LawForm;
using ::testing::HasSubstr;
using torch::Tensor;

/// A directory of its own for each test.
class ScriptFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(info->test_suite_name()) + "." + info->name();
    for (char& c : name)
      if (c == '/') c = '_';
    directory_ = fs::temp_directory_path() / ("uniphy_" + name);
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  void TearDown() override { fs::remove_all(directory_); }
  fs::path file(const std::string& name) const { return directory_ / name; }

 private:
  fs::path directory_;
};

double relative(const Tensor& a, const Tensor& b) {
  return (a.to(torch::kFloat64) - b).norm().item<double>() / b.norm().item<double>();
}

struct Case {
  const char* name;
  LawForm form;
  Activation activation;
  int latent_size, width, hidden;
  torch::Dtype dtype;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class ScriptLawCase : public ScriptFiles, public ::testing::WithParamInterface<Case> {
 protected:
  kernels::LearnedLawWeights weights() const {
    const Case& c = GetParam();
    return testing::random_weights(c.form, c.latent_size, c.width, c.hidden, c.activation, 7);
  }
  /// float32 files are held to float32.
  double tolerance() const { return GetParam().dtype == torch::kFloat64 ? 1e-6 : 2e-4; }
  std::vector<double> code(unsigned seed) const {
    torch::manual_seed(seed);
    const Tensor z = 0.4 * torch::randn({GetParam().latent_size}, torch::kFloat64);
    return {z.data_ptr<double>(), z.data_ptr<double>() + z.numel()};
  }
};

TEST_P(ScriptLawCase, AgreesWithTheKernels) {
  const auto w = weights();
  save_script_law(file("law.pt"), w, GetParam().dtype);
  const ScriptLaw law = load_script_law(file("law.pt"), GetParam().dtype);
  EXPECT_EQ(law.latent_size, w.latent_size);
  EXPECT_EQ(law.form, w.form);
  for (const std::int64_t count : {1, 2, 300}) {
    const ScriptDifference d =
        compare_with_kernels(law, w, {code(1), code(2)}, probe_states(count, 3));
    EXPECT_LE(d.projection, tolerance()) << count;
    EXPECT_LE(d.stress, tolerance()) << count;
    if (count == 300) {
      RecordProperty("projection_difference", std::to_string(d.projection));
      std::printf("[ measured ] %s: projection %.2e, stress %.2e\n", GetParam().name, d.projection,
                  d.stress);
    }
  }
}

TEST_P(ScriptLawCase, AnswersInTheTypeAndShapeOfItsInput) {
  const auto w = weights();
  const torch::jit::Module module = script_law(w, GetParam().dtype);
  const ScriptLaw law{module, w.form, w.latent_size, GetParam().dtype};
  const Tensor z = torch::zeros({w.latent_size});
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    for (const std::int64_t count : {0, 1, 3}) {
      const Tensor F = torch::eye(3, dtype).repeat({count, 1, 1});
      const Tensor F_proj = law.project(F, z), tau = law.stress(F, 0.1 * F, z);
      EXPECT_EQ(F_proj.sizes(), F.sizes());
      EXPECT_EQ(tau.sizes(), F.sizes());
      EXPECT_EQ(F_proj.scalar_type(), dtype);
      EXPECT_EQ(tau.scalar_type(), dtype);
      EXPECT_TRUE(torch::isfinite(tau).all().item<bool>());
    }
  }
}

TEST_P(ScriptLawCase, TakesALatentForEachParticle) {
  const auto w = weights();
  const ScriptLaw law{script_law(w, GetParam().dtype), w.form, w.latent_size, GetParam().dtype};
  const Probe probe = probe_states(3, 5);
  torch::manual_seed(4);
  const Tensor z = 0.4 * torch::randn({3, w.latent_size}, torch::kFloat64);
  const Tensor F_proj = law.project(probe.F, z), tau = law.stress(F_proj, probe.C, z);
  for (int p = 0; p < 3; ++p) {
    const auto one = [p](const Tensor& t) { return t.slice(0, p, p + 1); };
    const Tensor alone = law.project(one(probe.F), z[p]);
    EXPECT_LE(relative(F_proj[p], alone[0]), tolerance());
    EXPECT_LE(relative(tau[p], law.stress(alone, one(probe.C), z[p])[0]), tolerance());
  }
}

TEST_P(ScriptLawCase, RunsWhereNoneOfThisProjectIsLinked) {
  const auto w = weights();
  save_script_law(file("law.pt"), w, GetParam().dtype);
  const Probe probe = probe_states(200, 9);
  const Tensor z = torch::tensor(code(6), torch::kFloat64);
  const ops::LawOutput out =
      ops::learned_law(ops::to_networks(w, torch::kFloat64), probe.F, probe.C, z);
  std::vector<Tensor> cases{probe.F, probe.C, z, out.F_proj, out.tau};
  const auto run = [this] {
    return std::system((std::string(UNIPHY_TORCHSCRIPT_CONSUMER) + " " + file("law.pt").string() +
                        " " + file("cases.pt").string())
                           .c_str());
  };
  torch::save(cases, file("cases.pt").string());
  EXPECT_EQ(run(), 0);
  // It must notice a wrong answer too.
  cases[4] = out.tau * 1.01;
  torch::save(cases, file("cases.pt").string());
  EXPECT_NE(run(), 0);
}

/// Three training codes.
ScriptCodes some_codes(int latent_size) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  ScriptCodes codes;
  codes.materials = {"elastic", "sand", "elastic"};
  for (int k = 0; k < 3 * latent_size; ++k) codes.z.push_back(0.1 * k - 0.7);
  codes.parameters = {
      {1e5, 2e5, none, none, none}, {3e5, 4e5, none, 0.5, none}, {5e5, 6e5, none, none, none}};
  return codes;
}

TEST_P(ScriptLawCase, CarriesTheTrainingCodes) {
  const auto w = weights();
  const ScriptCodes codes = some_codes(w.latent_size);
  save_script_law(file("law.pt"), w, GetParam().dtype, codes);
  const ScriptLaw law = load_script_law(file("law.pt"));
  EXPECT_EQ(law.materials(), codes.materials);
  const auto row = [&](int i) {
    const auto begin = codes.z.begin() + i * w.latent_size;
    return torch::tensor(std::vector<double>(begin, begin + w.latent_size), torch::kFloat64)
        .to(GetParam().dtype);
  };
  EXPECT_TRUE(torch::equal(law.code_of("elastic"), row(0)));
  EXPECT_TRUE(torch::equal(law.code_of("sand"), row(1)));
  EXPECT_TRUE(torch::equal(law.module.attr("codes").toTensor()[2], row(2)));
  const Tensor parameters = law.module.attr("material_parameters").toTensor();
  EXPECT_EQ(parameters[1][1].item<double>(), 4e5);
  EXPECT_TRUE(parameters[1][2].isnan().item<bool>());
  // A code of the file is an argument of its methods.
  const Tensor F = torch::eye(3).unsqueeze(0);
  EXPECT_EQ(law.project(F, law.code_of("sand")).sizes(), F.sizes());
  try {
    law.code_of("cheese");
    FAIL() << "no error";
  } catch (const std::exception& e) {
    EXPECT_THAT(e.what(),
                HasSubstr("uniphy law: material: expected one of elastic, sand, found cheese"));
  }
}

/// As a user in Python does it, and the methods' files in plain PyTorch on the same numbers.
TEST_P(ScriptLawCase, RunsInPython) {
  if (GetParam().dtype != torch::kFloat64) GTEST_SKIP() << "float64 alone is precise enough";
  // Differentiable at rest.
  auto w = weights();
  if (w.form == LawForm::isotropic) {
    w = testing::with_caps(w, 1.5, 3);
    // Coefficients that spread over decades make stresses that differences cannot resolve.
    for (double& weight : w.stress.layers.back().weight) weight *= 0.1;
  }
  save_script_law(file("law.pt"), w, GetParam().dtype, some_codes(w.latent_size));
  const std::string command =
      std::string("PYTHONDONTWRITEBYTECODE=1 " UNIPHY_PYTHON " " UNIPHY_SOURCE_DIR) +
      "/tests/models/torchscript_python.py " + file("law.pt").string() +
      " " UNIPHY_SOURCE_DIR "/models/script";
  const int status = std::system(command.c_str());
  ASSERT_TRUE(WIFEXITED(status));
  // 127: no such program.
  if (WEXITSTATUS(status) == 77 || WEXITSTATUS(status) == 127)
    GTEST_SKIP() << "no torch in " UNIPHY_PYTHON " (Debian: python3-torch)";
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

INSTANTIATE_TEST_SUITE_P(
    All, ScriptLawCase,
    ::testing::Values(
        Case{"isotropic_gelu", LawForm::isotropic, Activation::gelu, 8, 32, 3, torch::kFloat64},
        Case{"isotropic_silu", LawForm::isotropic, Activation::silu, 1, 16, 2, torch::kFloat64},
        Case{"isotropic_squareplus_no_latent", LawForm::isotropic, Activation::squareplus, 0, 16, 1,
             torch::kFloat64},
        Case{"isotropic_silu_float32", LawForm::isotropic, Activation::silu, 8, 32, 3,
             torch::kFloat32},
        Case{"published_gelu", LawForm::published, Activation::gelu, 32, 128, 4, torch::kFloat64},
        Case{"published_linear", LawForm::published, Activation::silu, 2, 8, 0, torch::kFloat64},
        Case{"published_silu_float32", LawForm::published, Activation::silu, 8, 32, 2,
             torch::kFloat32}),
    [](const auto& info) { return std::string(info.param.name); });

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

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
    return message_of([this] { load_script_law(file("law.pt")); });
  }
  std::string prefix() const { return file("law.pt").string() + ": "; }
};

TEST_F(ScriptLawErrors, AnUnchangedLawIsAccepted) {
  EXPECT_EQ(after([](auto&) {}), "no error");
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
  EXPECT_EQ(message_of([&] { script_law(small(), torch::kFloat64, short_of_z); }),
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
  EXPECT_EQ(message_of([this] { load_script_law(file("law.pt"), torch::kFloat32); }),
            prefix() + "attribute dtype: expected \"float32\", found \"float64\"");
}

TEST_F(ScriptLawErrors, AModuleOfAnotherKind) {
  torch::jit::Module module("__torch__.Other");
  module.define("def forward(self, x: Tensor) -> Tensor:\n    return x\n");
  module.save(file("law.pt").string());
  EXPECT_EQ(message_of([this] { load_script_law(file("law.pt")); }),
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
  EXPECT_EQ(message_of([this] { load_script_law(file("law.pt")); }),
            prefix() + "method stress: expected to be there, found none");
}

TEST_F(ScriptLawErrors, FilesThatAreNoLaw) {
  EXPECT_EQ(message_of([this] { load_script_law(file("law.pt")); }),
            prefix() + "expected a TorchScript file, found no such file");
  std::ofstream(file("law.pt")) << "model: isotropic\n";
  EXPECT_EQ(message_of([this] { load_script_law(file("law.pt")); }),
            prefix() +
                "expected a TorchScript file (a zip archive), found something else of 17 "
                "bytes");
  // An archive of tensors is no program.
  torch::save(std::vector<Tensor>{torch::zeros(3)}, file("law.pt").string());
  EXPECT_THAT(message_of([this] { load_script_law(file("law.pt")); }), HasSubstr(prefix()));
}

TEST_F(ScriptLawErrors, TruncatedFiles) {
  save_script_law(file("whole.pt"), small(), torch::kFloat64);
  const auto size = fs::file_size(file("whole.pt"));
  for (const double part : {0.1, 0.5, 0.9, 0.999}) {
    fs::copy_file(file("whole.pt"), file("law.pt"), fs::copy_options::overwrite_existing);
    fs::resize_file(file("law.pt"), std::uintmax_t(double(size) * part));
    EXPECT_THAT(message_of([this] { load_script_law(file("law.pt")); }),
                HasSubstr(prefix() + "expected a whole TorchScript file, found one that LibTorch "
                                     "cannot read, truncated or damaged: "))
        << part;
  }
}

TEST_F(ScriptLawErrors, UnwritableFile) {
  EXPECT_THAT(message_of([this] {
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
