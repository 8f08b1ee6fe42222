// The exported law against the kernels, in C++ and in Python.

#include "models/torchscript.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <torch/script.h>
#include <torch/serialize.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "models/script_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/learned/learned_law.hpp"
#include "tests/models/script_files.hpp"
#include "tests/support/caps.hpp"
#include "tests/support/random_weights.hpp"

namespace uniphy::models {
namespace {

using kernels::Activation;
using kernels::LawForm;
using ::testing::HasSubstr;
using torch::Tensor;

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

}  // namespace
}  // namespace uniphy::models
