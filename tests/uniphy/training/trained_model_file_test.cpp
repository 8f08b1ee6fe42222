#include "uniphy/training/trained_model_file.hpp"

#include <ATen/CPUGeneratorImpl.h>
#include <gtest/gtest.h>

#include "ops/base/torch.hpp"
#include "tests/support/error_of.hpp"

namespace uniphy {
namespace {

models::TrainedModel small_model() {
  models::LearnedLawOptions o;
  o.latent_size = 5;
  o.hidden_layers = 2;
  o.width = 16;
  MaterialParameters sand = no_parameters(), elastic = no_parameters();
  sand[0] = 1e5;
  sand[3] = 0.3;
  elastic[1] = 2e5;
  torch::Generator generator = torch::make_generator<at::CPUGeneratorImpl>(3);
  torch::manual_seed(11);
  return {
      models::LearnedLaw(o, generator),
      models::LatentCodes(torch::randn({3, 5}), std::vector<std::string>{"sand", "elastic", "sand"},
                          std::vector<MaterialParameters>{sand, elastic, sand})};
}

TEST(TrainedModelFile, GivesTheModelBack) {
  const models::TrainedModel model = small_model();
  EXPECT_EQ(model.codes->size(), 3);
  EXPECT_EQ(model.codes->latent_size(), 5);
  EXPECT_TRUE(model.codes->z.requires_grad());
  const ModelFile file = model_file(model, "seed: 1\n", {1e-4, 2e-4});
  EXPECT_EQ(file.training_dt, (std::array<double, 2>{1e-4, 2e-4}));
  EXPECT_EQ(file.config, "seed: 1\n");
  const models::TrainedModel again = trained_model(file);
  EXPECT_TRUE(torch::equal(again.codes->z, model.codes->z));
  EXPECT_EQ(again.codes->materials(), model.codes->materials());
  EXPECT_EQ(again.codes->material_parameters()[1][1], 2e5);
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_TRUE(torch::equal(again.law->parameters()[k], model.law->parameters()[k]));
}

TEST(TrainedModelFile, RefusesCodesOfAnotherSize) {
  ModelFile file = model_file(small_model(), "");
  file.latents.pop_back();
  EXPECT_EQ(testing::error_of([&] { trained_model(file); }),
            "latent codes: expected 15 numbers, found 14");
}

}  // namespace
}  // namespace uniphy
