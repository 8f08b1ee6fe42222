#include "uniphy/io/model_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5.hpp"

// HDF5 itself loses memory when a file is damaged; ours is watched all the same.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5"; }

namespace uniphy {
namespace {

kernels::MlpWeights network_of(const std::vector<int>& widths, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  kernels::MlpWeights network;
  for (std::size_t k = 0; k + 1 < widths.size(); ++k) {
    kernels::MlpWeights::Layer layer;
    layer.in = widths[k];
    layer.out = widths[k + 1];
    for (int i = 0; i < layer.in * layer.out; ++i) layer.weight.push_back(normal(generator));
    for (int i = 0; i < layer.out; ++i) layer.bias.push_back(normal(generator));
    network.layers.push_back(layer);
  }
  return network;
}

ModelFile example(kernels::LawForm form = kernels::LawForm::isotropic) {
  const auto shape = kernels::network_shape(form);
  ModelFile model;
  model.weights.form = form;
  model.weights.latent_size = 4;
  model.weights.activation = kernels::Activation::silu;
  model.weights.projection = network_of({shape.projection_in + 4, 5, shape.projection_out}, 1);
  model.weights.stress = network_of({shape.stress_in + 4, 6, 7, shape.stress_out}, 2);
  model.latents = {1, 2, 3, 4, 5, 6, 7, 8};
  model.materials = {"elastic", "sand"};
  model.parameters = {no_parameters(), no_parameters()};
  model.parameters[1][3] = 0.25;
  model.config = "epochs: 5\n";
  model.training_dt = {1e-4, 2e-4};
  return model;
}

TEST(ModelFile, ReadsBackToTheSameBitsInBothForms) {
  for (const auto form : {kernels::LawForm::isotropic, kernels::LawForm::published}) {
    const testing::Scratch scratch;
    const ModelFile written = example(form);
    write_model(scratch.file("m.h5"), written);
    const ModelFile read = read_model(scratch.file("m.h5"));
    EXPECT_EQ(read.weights.form, form);
    EXPECT_EQ(read.weights.latent_size, 4);
    EXPECT_EQ(read.weights.activation, kernels::Activation::silu);
    ASSERT_EQ(read.weights.stress.layers.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(read.weights.stress.layers[k].weight, written.weights.stress.layers[k].weight);
      EXPECT_EQ(read.weights.stress.layers[k].bias, written.weights.stress.layers[k].bias);
    }
    EXPECT_EQ(read.weights.projection.layers[1].weight,
              written.weights.projection.layers[1].weight);
    EXPECT_EQ(read.latents, written.latents);
    EXPECT_EQ(read.materials, written.materials);
    EXPECT_TRUE(std::isnan(read.parameters[1][0]));
    EXPECT_EQ(read.parameters[1][3], 0.25);
    EXPECT_EQ(read.config, "epochs: 5\n");
    EXPECT_EQ(read.training_dt, written.training_dt);
    EXPECT_EQ(read.codes(), 2);
    EXPECT_THAT(read.code(1), ::testing::ElementsAre(5, 6, 7, 8));
    EXPECT_EQ(testing::error_of([&] { read.code(2); }), "latent 2: expected an index from 0 to 1");
  }
}

TEST(ModelFile, NumbersBeyondSenseAreNamed) {
  const testing::Scratch scratch;
  const auto error = [&](const ModelFile& model) {
    write_model(scratch.file("m.h5"), model);
    return testing::without_directory(testing::error_of([&] { read_model(scratch.file("m.h5")); }),
                                      scratch.path());
  };
  ModelFile model = example();
  model.latents[2] = 1e300;
  EXPECT_EQ(error(model),
            "m.h5: /latents/z: expected numbers of at most 1e+06 either way, found 1e+300 at "
            "position 2");
  model = example();
  model.weights.stress.layers[1].bias[0] = -1e300;
  EXPECT_EQ(error(model),
            "m.h5: /stress/layer_1/bias: expected numbers of at most 1e+06 either way, found "
            "-1e+300 at position 0");
}

TEST(ModelFile, SinglePrecisionRoundsTheWeightsOnly) {
  const testing::Scratch scratch;
  const ModelFile written = example();
  write_model(scratch.file("m.h5"), written, true);
  const ModelFile read = read_model(scratch.file("m.h5"));
  EXPECT_EQ(read.latents, written.latents);
  const double weight = written.weights.stress.layers[0].weight[3];
  EXPECT_EQ(read.weights.stress.layers[0].weight[3],
            static_cast<double>(static_cast<float>(weight)));
}

TEST(ModelFile, WeightsThatDoNotFitAreNotWritten) {
  struct Case {
    const char* message;
    std::function<void(ModelFile&)> spoil;
  };
  const Case cases[] = {
      {"projection/layer_0: expected 7 inputs (features and latent), found 8",
       [](ModelFile& m) { m.weights.projection.layers[0].in = 8; }},
      {"stress/layer_1: expected 6 inputs, found 5",
       [](ModelFile& m) { m.weights.stress.layers[1].in = 5; }},
      {"stress/layer_2: expected 14 outputs, found 3",
       [](ModelFile& m) { m.weights.stress.layers[2].out = 3; }},
      {"stress/layer_0/weight: expected 60 numbers, found 59",
       [](ModelFile& m) { m.weights.stress.layers[0].weight.pop_back(); }},
      {"stress/layer_0/bias: expected 6 numbers, found 7",
       [](ModelFile& m) { m.weights.stress.layers[0].bias.push_back(0); }},
      {"projection/layer_1/bias: expected finite numbers, found inf",
       [](ModelFile& m) { m.weights.projection.layers[1].bias[0] = INFINITY; }},
      {"projection: expected at least one layer, found none",
       [](ModelFile& m) { m.weights.projection.layers.clear(); }},
      {"latent_size: expected at least 0, found -1",
       [](ModelFile& m) { m.weights.latent_size = -1; }},
      {"m.h5: /latents/z: expected 8 numbers for the shape [2, 4], found 7",
       [](ModelFile& m) { m.latents.pop_back(); }},
      {"m.h5: /latents/parameters: expected 2 rows, found 1",
       [](ModelFile& m) { m.parameters.pop_back(); }},
  };
  for (const Case& c : cases) {
    const testing::Scratch scratch;
    ModelFile model = example();
    c.spoil(model);
    EXPECT_EQ(
        testing::without_directory(
            testing::error_of([&] { write_model(scratch.file("m.h5"), model); }), scratch.path()),
        c.message);
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
  }
}

constexpr auto kShape = kernels::network_shape(kernels::LawForm::isotropic);

/// A well-formed small model file, with one thing spoilt.
struct Layout {
  std::string format = "uniphy-model";
  int version = 2;
  std::string form = "isotropic";
  std::string activation = "gelu";
  std::string dtype = "float64";
  std::string stress_units = "Pa";
  std::string rate_units = "1/s";
  std::int64_t latent_size = 2;
  std::int64_t stress_in = kShape.stress_in + 2;
  std::int64_t bias_size = kShape.stress_out;
  double weight = 0.5;
  std::string layer_name = "layer_0";
  std::int64_t latent_rows = 1;
  std::vector<double> training_dt{1e-4, 2e-4};
};

std::string message_of(const std::function<void(Layout&)>& spoil) {
  Layout l;
  spoil(l);
  const testing::Scratch scratch;
  hdf5::Writer w(scratch.file("m.h5"));
  const hdf5::Info info{"1", ""};
  w.attribute("/", "format", l.format);
  w.attribute("/", "version", l.version);
  w.attribute("/", "form", l.form);
  w.attribute("/", "activation", l.activation);
  w.attribute("/", "dtype", l.dtype);
  w.attribute("/", "stress_units", l.stress_units);
  w.attribute("/", "rate_units", l.rate_units);
  w.attribute("/", "latent_size", l.latent_size);
  w.attribute("/", "config", "");
  w.attribute("/", "training_dt", l.training_dt);
  w.write("projection/layer_0/weight",
          std::vector<double>(kShape.projection_out * (kShape.projection_in + 2), 0.5),
          {kShape.projection_out, kShape.projection_in + 2}, info);
  w.write("projection/layer_0/bias", std::vector<double>(kShape.projection_out),
          {kShape.projection_out}, info);
  w.write("stress/" + l.layer_name + "/weight",
          std::vector<double>(kShape.stress_out * l.stress_in, l.weight),
          {kShape.stress_out, l.stress_in}, info);
  w.write("stress/" + l.layer_name + "/bias", std::vector<double>(l.bias_size), {l.bias_size},
          info);
  w.write("latents/z", std::vector<double>(2 * l.latent_rows), {l.latent_rows, 2}, info);
  w.write_strings("latents/material", {"sand"}, info);
  w.write("latents/parameters", std::vector<double>(5), {1, 5}, info);
  w.commit();
  return testing::without_directory(testing::error_of([&] { read_model(scratch.file("m.h5")); }),
                                    scratch.path());
}

TEST(ModelFile, MalformedFilesAreRefused) {
  EXPECT_EQ(message_of([](Layout& l) { l.format = "uniphy-dataset"; }),
            "m.h5: attribute format: expected \"uniphy-model\", found \"uniphy-dataset\"");
  EXPECT_EQ(message_of([](Layout& l) { l.version = 1; }),
            "m.h5: attribute version: expected 2, found 1; train the model again");
  EXPECT_EQ(message_of([](Layout& l) { l.form = "neural"; }),
            "m.h5: attribute form: expected a form of the law from isotropic, published, found "
            "\"neural\"");
  EXPECT_EQ(message_of([](Layout& l) { l.activation = "relu"; }),
            "m.h5: attribute activation: expected an activation from gelu, silu, squareplus, found "
            "\"relu\"");
  EXPECT_EQ(message_of([](Layout& l) { l.dtype = "float16"; }),
            "m.h5: attribute dtype: expected \"float64\" or \"float32\", found \"float16\"");
  EXPECT_EQ(message_of([](Layout& l) { l.stress_units = "kPa"; }),
            "m.h5: attribute stress_units: expected \"Pa\", found \"kPa\"");
  EXPECT_EQ(message_of([](Layout& l) { l.rate_units = "1/ms"; }),
            "m.h5: attribute rate_units: expected \"1/s\", found \"1/ms\"");
  EXPECT_EQ(message_of([](Layout& l) { l.latent_size = 32; }),
            "m.h5: weights: projection/layer_0: expected 35 inputs (features and latent), found 5");
  EXPECT_EQ(message_of([](Layout& l) { l.latent_size = std::int64_t{1} << 40; }),
            "m.h5: attribute latent_size: expected 0 to 4096, found 1099511627776");
  EXPECT_EQ(message_of([](Layout& l) { l.stress_in = 9; }),
            "m.h5: weights: stress/layer_0: expected 8 inputs (features and latent), found 9");
  EXPECT_EQ(message_of([](Layout& l) { l.bias_size = 1; }),
            "m.h5: /stress/layer_0/bias: expected the shape [14], found [1]");
  EXPECT_EQ(message_of([](Layout& l) { l.weight = std::nan(""); }),
            "m.h5: /stress/layer_0/weight: expected finite numbers, found nan at position 0");
  EXPECT_EQ(message_of([](Layout& l) { l.layer_name = "layer_1"; }),
            "m.h5: /stress/layer_0/weight: expected a dataset, found nothing of that name");
  for (const std::vector<double>& dt :
       {std::vector<double>{2e-4, 1e-4}, {0, 1e-4}, {1e-4, INFINITY}})
    EXPECT_THAT(message_of([&](Layout& l) { l.training_dt = dt; }),
                ::testing::HasSubstr("m.h5: attribute training_dt"));
  EXPECT_THAT(message_of([](Layout& l) { l.training_dt = {1e-4}; }),
              ::testing::HasSubstr("training_dt"));
  EXPECT_EQ(message_of([](Layout& l) { l.latent_rows = 3; }),
            "m.h5: /latents/z: expected the shape [1, 2], found [3, 2]");
}

// A damaged file is an error or reads as some model, but never ends the program. HDF5's own parser
// is under test here too, hence flips in the data that this project reads first.
TEST(ModelFile, FlippedBytesNeverEndTheProgram) {
  const testing::Scratch scratch;
  write_model(scratch.file("m.h5"), example());
  const std::string good = read_text_file(scratch.file("m.h5"));
  std::mt19937 generator(7);
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    std::string bad = good;
    bad[generator() % bad.size()] ^= static_cast<char>(1u << generator() % 8);
    scratch.write("bad.h5", bad);
    try {
      read_model(scratch.file("bad.h5"));
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 20);
}

}  // namespace
}  // namespace uniphy
