#include "uniphy/io/hdf5.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <numeric>

#include "tests/support/error_of.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"

namespace uniphy {
namespace {

using hdf5::Reader;
using hdf5::Shape;
using hdf5::Values;
using hdf5::Writer;
using ::testing::ElementsAre;

template <class T>
class Hdf5RoundTrip : public ::testing::Test {};
using Types = ::testing::Types<double, float, std::int32_t, std::int64_t>;
TYPED_TEST_SUITE(Hdf5RoundTrip, Types);

TYPED_TEST(Hdf5RoundTrip, KeepsEveryBitPlainAndCompressed) {
  const testing::Scratch scratch;
  std::vector<TypeParam> data(3000);
  std::iota(data.begin(), data.end(), TypeParam(1));
  data[0] = std::numeric_limits<TypeParam>::lowest();
  data[1] = std::numeric_limits<TypeParam>::max();
  Writer writer(scratch.file("a.h5"));
  writer.write("plain", data, {100, 10, 3}, {"m", "numbers"});
  writer.write("deep/er/packed", data, {1000, 3}, {"m", "numbers", 6});
  writer.write("empty", std::vector<TypeParam>(), {0, 3}, {"m", "none", 6});
  writer.write("scalar", std::vector<TypeParam>{7}, {}, {"m", "one"});
  writer.commit();

  const Reader reader(scratch.file("a.h5"));
  EXPECT_EQ(reader.read<TypeParam>("plain", {-1, 10, 3}), data);
  EXPECT_EQ(reader.read<TypeParam>("/deep/er/packed", {1000, -1}), data);
  EXPECT_TRUE(reader.read<TypeParam>("empty", {-1, 3}).empty());
  EXPECT_THAT(reader.read<TypeParam>("scalar", {}), ElementsAre(TypeParam(7)));
  EXPECT_EQ(reader.shape("plain"), (Shape{100, 10, 3}));
  EXPECT_EQ(reader.attribute_text("plain", "units"), "m");
  EXPECT_EQ(reader.attribute_text("deep/er/packed", "description"), "numbers");
  const auto rows = reader.read_rows<TypeParam>("plain", {-1, 10, 3}, 40, 2);
  EXPECT_EQ(rows, std::vector<TypeParam>(data.begin() + 1200, data.begin() + 1260));
}

TYPED_TEST(Hdf5RoundTrip, AppendedRowsReadBackAsOneArray) {
  const testing::Scratch scratch;
  std::vector<TypeParam> data(5000 * 3);
  std::iota(data.begin(), data.end(), TypeParam(0));
  Writer writer(scratch.file("a.h5"));
  writer.template extendible<TypeParam>("rows", {3}, {"1", "appended", 4});
  for (int row = 0; row < 5000;) {
    const int count = std::min(1 + row % 700, 5000 - row);
    writer.append("rows", data.data() + 3 * row, count);
    row += count;
  }
  writer.append("rows", std::vector<TypeParam>());
  writer.commit();
  EXPECT_EQ(Reader(scratch.file("a.h5")).read<TypeParam>("rows", {5000, 3}), data);
}

TEST(Hdf5, TextsReadBackWhateverTheyHold) {
  const testing::Scratch scratch;
  const std::vector<std::string> texts{"", "elastic", "caf\xC3\xA9 \xCE\xBC",
                                       std::string(100000, 'x')};
  const std::string long_text(200000, 'y');  // larger than what an attribute itself can hold
  Writer writer(scratch.file("a.h5"));
  writer.write_strings("texts", texts, {"1", "texts"});
  writer.write_strings("none", {}, {"1", "texts"});
  writer.attribute("/", "scene", long_text);
  writer.attribute("/", "scene", long_text + "!");
  writer.attribute("texts", "empty", "");
  writer.commit();
  const Reader reader(scratch.file("a.h5"));
  EXPECT_EQ(reader.read_strings("texts", 4), texts);
  EXPECT_TRUE(reader.read_strings("none").empty());
  EXPECT_EQ(reader.attribute_text("/", "scene"), long_text + "!");
  EXPECT_EQ(reader.attribute_text("texts", "empty"), "");
}

TEST(Hdf5, AttributesOfNumbers) {
  const testing::Scratch scratch;
  Writer writer(scratch.file("a.h5"));
  writer.group("scene/inner");
  writer.attribute("scene/inner", "dt", 5e-4);
  writer.attribute("scene/inner", "grid", 20);
  writer.attribute("scene/inner", "gravity", std::vector<double>{0, -9.8, 0});
  writer.commit();
  const Reader reader(scratch.file("a.h5"));
  EXPECT_EQ(reader.attribute_real("scene/inner", "dt"), 5e-4);
  EXPECT_EQ(reader.attribute_integer("/scene/inner", "grid"), 20);
  EXPECT_THAT(reader.attribute_reals("scene/inner", "gravity", 3), ElementsAre(0, -9.8, 0));
  EXPECT_FALSE(reader.has_attribute("scene", "dt"));
  EXPECT_FALSE(reader.has_attribute("nowhere", "dt"));
  EXPECT_THAT(reader.members("scene"), ElementsAre("inner"));
  EXPECT_TRUE(reader.has("scene/inner"));
  EXPECT_FALSE(reader.has("scene/inner/deeper"));
}

TEST(Hdf5, FloatingPointReadsInEitherPrecisionAndIntegersWhereTheyFit) {
  const testing::Scratch scratch;
  Writer writer(scratch.file("a.h5"));
  writer.write("single", std::vector<float>{0.1f}, {1}, {"m", ""});
  writer.write("wide", std::vector<std::int64_t>{-5, 1 << 30}, {2}, {"1", ""});
  writer.commit();
  const Reader reader(scratch.file("a.h5"));
  EXPECT_EQ(reader.read<double>("single", {1})[0], static_cast<double>(0.1f));
  EXPECT_THAT(reader.read<std::int32_t>("wide", {2}), ElementsAre(-5, 1 << 30));
}

TEST(Hdf5, OlderFileStaysUntilTheNewOneIsWhole) {
  const testing::Scratch scratch;
  const auto file = scratch.file("a.h5");
  const auto write = [&](double value, bool commit) {
    Writer writer(file);
    writer.write("x", std::vector<double>{value}, {1}, {"m", ""});
    if (commit) writer.commit();
  };
  write(1, true);
  write(2, false);
  EXPECT_EQ(Reader(file).read<double>("x", {1})[0], 1);
  EXPECT_FALSE(std::filesystem::exists(temporary_name(file)));
  write(3, true);
  EXPECT_EQ(Reader(file).read<double>("x", {1})[0], 3);
}

TEST(Hdf5, TheSameDataMakeTheSameBytes) {
  const testing::Scratch scratch;
  const auto bytes = [&](const char* name) {
    Writer writer(scratch.file(name));
    writer.write("deep/x", std::vector<double>{1, 2}, {2}, {"m", "numbers"});
    writer.extendible<double>("rows", {2}, {"m", "", 3});
    writer.append("rows", std::vector<double>{1, 2, 3, 4});
    writer.row_view("views/1", "rows", 1);
    writer.write_strings("texts", {"a", "b"}, {"1", ""});
    writer.attribute("/", "dt", 1e-3);
    writer.commit();
    return read_text_file(scratch.file(name));
  };
  const std::string first = bytes("a.h5");
  ::usleep(1100000);  // HDF5 stores times in whole seconds
  EXPECT_TRUE(bytes("b.h5") == first);
}

// Files that another stage reads: model.h5, dataset.h5, latent.h5, trajectory.h5, observation.h5.
TYPED_TEST(Hdf5RoundTrip, AFlippedBitOfTheNumbersIsAnError) {
  const testing::Scratch scratch;
  std::vector<TypeParam> data(3000);
  std::iota(data.begin(), data.end(), TypeParam(1));
  data[1234] = TypeParam(123456789);
  Writer writer(scratch.file("a.h5"));
  writer.write("numbers", data, {1000, 3}, {"m", "numbers"});
  writer.template extendible<TypeParam>("rows", {3}, {"m", "appended"});
  writer.append("rows", data);
  writer.commit();

  std::ifstream in(scratch.file("a.h5"), std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  const std::string number(reinterpret_cast<const char*>(&data[1234]), sizeof(TypeParam));
  int places = 0;
  for (std::size_t at = good.find(number); at != std::string::npos;
       at = good.find(number, at + 1)) {
    std::string bad = good;
    bad[at] ^= 4;
    scratch.write("b.h5", bad);
    const std::string message = testing::error_of([&] {
      const Reader reader(scratch.file("b.h5"));
      reader.read<TypeParam>("numbers", {1000, 3});
      reader.read<TypeParam>("rows", {-1, 3});
    });
    EXPECT_THAT(message, ::testing::HasSubstr("cannot be read: its checksum is wrong")) << at;
    ++places;
  }
  EXPECT_EQ(places, 2);
}

TEST(Hdf5, AnyValuesMayHoldNan) {
  const testing::Scratch scratch;
  Writer writer(scratch.file("a.h5"));
  writer.write("x", std::vector<double>{std::nan("")}, {1}, {"m", ""});
  writer.commit();
  EXPECT_TRUE(std::isnan(Reader(scratch.file("a.h5")).read<double>("x", {1}, Values::any)[0]));
}

TEST(Hdf5, WriterRefusesWhatDoesNotFit) {
  const testing::Scratch scratch;
  const auto message = [&](auto function) {
    return testing::without_directory(testing::error_of(function), scratch.path());
  };
  Writer writer(scratch.file("a.h5"));
  EXPECT_EQ(message([&] {
              writer.write("x", std::vector<double>(5), {2, 3}, {"m", ""});
            }),
            "a.h5: /x: expected 6 numbers for the shape [2, 3], found 5");
  writer.extendible<double>("rows", {3}, {"m", ""});
  EXPECT_EQ(message([&] { writer.append("rows", std::vector<double>(4)); }),
            "a.h5: /rows: expected whole rows of 3 numbers, found 4");
  EXPECT_EQ(message([&] { writer.append("other", std::vector<double>(3)); }),
            "a.h5: /other: expected an extendible dataset");
  EXPECT_EQ(message([&] { writer.row_view("views/0", "other", 0); }),
            "a.h5: /other: expected an extendible dataset");
  EXPECT_EQ(message([&] { writer.row_view("views/0", "rows", 0); }),
            "a.h5: /rows: expected a row below 0, found 0");
  EXPECT_EQ(message([&] { Writer(scratch.file("none/b.h5")); }),
            "none/b.h5: cannot be written: No such file or directory");
  std::filesystem::create_directory(scratch.file("folder.h5"));
  EXPECT_EQ(message([&] { Writer(scratch.file("folder.h5")); }),
            "folder.h5: expected a file, found a directory");
}

// What h5py stores where its user writes density = 1000, gravity = [0, -10, 0] and grid = 20.0.
TEST(Hdf5, ReadsIntegersAsRealsAndWholeRealsAsIntegers) {
  const testing::Scratch scratch;
  const hid_t file =
      H5Fcreate(scratch.file("f.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const auto attribute = [&](const char* name, hid_t type, const hid_t space, const void* data) {
    const hid_t id = H5Acreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(id, type, data);
    H5Aclose(id);
    H5Sclose(space);
  };
  const std::int64_t density = 1000, gravity[3] = {0, -10, 0};
  const double grid = 20, half = 20.5, huge = 1e300;
  const hsize_t three = 3;
  attribute("density", H5T_STD_I64LE, H5Screate(H5S_SCALAR), &density);
  attribute("gravity", H5T_STD_I64LE, H5Screate_simple(1, &three, nullptr), gravity);
  attribute("grid", H5T_IEEE_F64LE, H5Screate(H5S_SCALAR), &grid);
  attribute("half", H5T_IEEE_F64LE, H5Screate(H5S_SCALAR), &half);
  attribute("huge", H5T_IEEE_F64LE, H5Screate(H5S_SCALAR), &huge);
  const hid_t space = H5Screate_simple(1, &three, nullptr);
  const hid_t set =
      H5Dcreate2(file, "x", H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(set, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, gravity);
  H5Dclose(set);
  H5Sclose(space);
  H5Fclose(file);

  const hdf5::Reader reader(scratch.file("f.h5"));
  EXPECT_EQ(reader.attribute_real("/", "density"), 1000);
  EXPECT_EQ(reader.attribute_reals("/", "gravity", 3), (std::vector<double>{0, -10, 0}));
  EXPECT_EQ(reader.attribute_integer("/", "grid"), 20);
  EXPECT_EQ(reader.read<double>("x", {3}), (std::vector<double>{0, -10, 0}));
  for (const char* name : {"half", "huge"}) {
    EXPECT_THAT(testing::error_of([&] { reader.attribute_integer("/", name); }),
                ::testing::HasSubstr("expected an integer, found"));
  }
}

TEST(Hdf5, RefusesTextThatIsNotUtf8) {
  const testing::Scratch scratch;
  hdf5::Writer writer(scratch.file("f.h5"));
  writer.write_strings("names", {"sand", "s\xff"}, {"1", "names"});
  writer.attribute("/", "law", "\xc3(");
  writer.commit();
  const hdf5::Reader reader(scratch.file("f.h5"));
  EXPECT_THAT(testing::error_of([&] { reader.read_strings("names"); }),
              ::testing::HasSubstr("/names: expected UTF-8 text, found \"s\\xff\""));
  EXPECT_THAT(testing::error_of([&] { reader.attribute_text("/", "law"); }),
              ::testing::HasSubstr("attribute law: expected UTF-8 text, found \"\\xc3(\""));
}

}  // namespace
}  // namespace uniphy
