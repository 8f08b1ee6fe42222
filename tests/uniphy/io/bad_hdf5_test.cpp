// Malformed HDF5 files, each with its whole message. They are made with the plain C API, for the
// writer would refuse to make them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include <cmath>
#include <functional>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {
namespace {

using hdf5::Reader;
using hdf5::Values;
using hdf5::Writer;
using ::testing::HasSubstr;
using ::testing::StartsWith;

using Path = std::filesystem::path;

struct Case {
  const char* name;
  std::function<void(const Path&)> make;
  std::function<void(const Path&)> read;
  const char* message;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class BadHdf5 : public ::testing::TestWithParam<Case> {};

TEST_P(BadHdf5, IsRefusedWithItsMessage) {
  const testing::Scratch scratch;
  const Path file = scratch.file("f.h5");
  GetParam().make(file);
  const std::string message = testing::error_of([&] { GetParam().read(file); });
  EXPECT_EQ(testing::without_directory(message, scratch.path()), GetParam().message);
}

void open_only(const Path& file) { Reader reader(file); }

void read_x(const Path& file) { Reader(file).read<double>("x", {-1, 3}, Values::finite); }

/// A file with one dataset x [2, 3] or as asked.
std::function<void(const Path&)> with_x(const std::vector<double>& data, const hdf5::Shape& shape) {
  return [=](const Path& file) {
    Writer writer(file);
    writer.write("x", data, shape, {"m", ""});
    writer.commit();
  };
}

/// A file in which `fill` does what it likes with the C API.
std::function<void(const Path&)> raw(const std::function<void(hid_t)>& fill) {
  return [=](const Path& path) {
    const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    fill(file);
    H5Fclose(file);
  };
}

void write_unsigned(hid_t file) {
  const hsize_t size = 1;
  const std::uint64_t value = ~std::uint64_t{0};
  const hid_t space = H5Screate_simple(1, &size, nullptr);
  const hid_t set =
      H5Dcreate2(file, "x", H5T_NATIVE_UINT64, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(set, H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value);
  H5Dclose(set);
  H5Sclose(space);
}

void make_dataset(hid_t file, const std::vector<hsize_t>& size, hid_t type, hid_t properties) {
  const hid_t space = H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr);
  H5Dclose(H5Dcreate2(file, "x", type, space, H5P_DEFAULT, properties, H5P_DEFAULT));
  H5Sclose(space);
}

constexpr hsize_t kTera = hsize_t{1} << 40;

void terabyte_plain(hid_t file) { make_dataset(file, {kTera, 3}, H5T_NATIVE_DOUBLE, H5P_DEFAULT); }

void terabyte_chunked(hid_t file) {
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t chunk[] = {64, 3};
  H5Pset_chunk(properties, 2, chunk);
  H5Pset_deflate(properties, 6);
  make_dataset(file, {kTera, 3}, H5T_NATIVE_DOUBLE, properties);
  H5Pclose(properties);
}

void overflowing(hid_t file) {
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t chunk[] = {64, 3};
  H5Pset_chunk(properties, 2, chunk);
  make_dataset(file, {hsize_t{1} << 62, 3}, H5T_NATIVE_DOUBLE, properties);
  H5Pclose(properties);
}

void external_storage(hid_t file) {
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_external(properties, "/etc/passwd", 0, 48);
  make_dataset(file, {2, 3}, H5T_NATIVE_DOUBLE, properties);
  H5Pclose(properties);
}

void other_filter(hid_t file) {
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t chunk[] = {2, 3};
  H5Pset_chunk(properties, 2, chunk);
  H5Pset_scaleoffset(properties, H5Z_SO_FLOAT_DSCALE, 2);
  make_dataset(file, {2, 3}, H5T_NATIVE_DOUBLE, properties);
  H5Pclose(properties);
}

/// Cuts the last half off a good file.
void truncated(const Path& file) {
  with_x(std::vector<double>(3000), {1000, 3})(file);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
}

std::function<void(const Path&)> text(const std::string& content) {
  return [=](const Path& file) { write_text_file(file, content); };
}

/// A file whose attribute `value` of the root is what `set` writes.
std::function<void(const Path&)> with_attribute(const std::function<void(Writer&)>& set) {
  return [=](const Path& file) {
    Writer writer(file);
    set(writer);
    writer.commit();
  };
}

const std::vector<double> kSix{1, 2, 3, 4, 5, 6};

const std::vector<Case> kCases{
    {"Missing", [](const Path&) {}, open_only,
     "f.h5: expected an HDF5 file, found nothing of that name"},
    {"Directory", [](const Path& file) { std::filesystem::create_directory(file); }, open_only,
     "f.h5: expected an HDF5 file, found a directory"},
    {"Empty", text(""), open_only, "f.h5: expected an HDF5 file, found an empty file"},
    {"Text", text("hello"), open_only, "f.h5: expected an HDF5 file, found another format"},
    {"NoDataset", with_x(kSix, {2, 3}), [](const Path& f) { Reader(f).read<double>("y", {-1}); },
     "f.h5: /y: expected a dataset, found nothing of that name"},
    {"GroupForDataset", raw([](hid_t file) {
       H5Gclose(H5Gcreate2(file, "x", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
     }),
     read_x, "f.h5: /x: expected a dataset, found a group"},
    {"DatasetForGroup", with_x(kSix, {2, 3}), [](const Path& f) { Reader(f).members("x"); },
     "f.h5: /x: expected a group, found a dataset"},
    {"Rank", with_x(kSix, {6}), read_x, "f.h5: /x: expected the shape [-1, 3], found [6]"},
    {"Extent", with_x(kSix, {3, 2}), read_x, "f.h5: /x: expected the shape [-1, 3], found [3, 2]"},
    {"NotFinite", with_x({1, 2, 3, 4, std::nan(""), 6}, {2, 3}), read_x,
     "f.h5: /x: expected finite numbers, found nan at position 4"},
    {"Infinite", with_x({1, 2, -INFINITY, 4, 5, 6}, {2, 3}), read_x,
     "f.h5: /x: expected finite numbers, found -inf at position 2"},
    {"RealsForIntegers", with_x(kSix, {6}),
     [](const Path& f) { Reader(f).read<std::int32_t>("x", {6}); },
     "f.h5: /x: expected integers, found float64"},
    {"IntegerDoesNotFit", with_attribute([](Writer& w) {
       w.write("x", std::vector<std::int64_t>{5, std::int64_t{1} << 31}, {2}, {"1", ""});
     }),
     [](const Path& f) { Reader(f).read<std::int32_t>("x", {2}); },
     "f.h5: /x: expected integers of 32 bits, found 2147483648"},
    {"Unsigned64", raw(write_unsigned),
     [](const Path& f) { Reader(f).read<std::int64_t>("x", {1}); },
     "f.h5: /x: expected integers of at most 64 bits with sign, found uint64"},
    {"TextForReals", with_attribute([](Writer& w) {
       w.write_strings("x", {"a"}, {"1", ""});
     }),
     read_x, "f.h5: /x: expected numbers, found text"},
    {"RealsForText", with_x(kSix, {6}), [](const Path& f) { Reader(f).read_strings("x"); },
     "f.h5: /x: expected text, found float64"},
    {"CountOfTexts", with_attribute([](Writer& w) {
       w.write_strings("x", {"a", "b"}, {"1", ""});
     }),
     [](const Path& f) { Reader(f).read_strings("x", 3); },
     "f.h5: /x: expected the shape [3], found [2]"},
    {"RowsBeyondTheEnd", with_x(kSix, {2, 3}),
     [](const Path& f) {
       Reader(f).read_rows<double>("x", {-1, 3}, 1, 2);
     },
     "f.h5: /x: expected rows 1 to 3, found 2 rows"},
    {"ExternalStorage", raw(external_storage), read_x,
     "f.h5: /x: expected data inside the file, found a reference to another file"},
    {"ExternalLink", raw([](hid_t file) {
       H5Lcreate_external("other.h5", "/x", file, "x", H5P_DEFAULT, H5P_DEFAULT);
     }),
     read_x, "f.h5: /x: expected data inside the file, found a link to another file"},
    {"DanglingLink",
     raw([](hid_t file) { H5Lcreate_soft("/gone", file, "x", H5P_DEFAULT, H5P_DEFAULT); }), read_x,
     "f.h5: /x: expected a dataset, found nothing of that name"},
    {"LinkLoop", raw([](hid_t file) { H5Lcreate_soft("/x", file, "x", H5P_DEFAULT, H5P_DEFAULT); }),
     read_x, "f.h5: /x: expected a dataset, found nothing of that name"},
    {"OtherFilter", raw(other_filter), read_x,
     "f.h5: /x: expected data stored plainly or with gzip, found the filter 6 (\"scaleoffset\")"},
    {"NoFormat", with_x(kSix, {2, 3}), [](const Path& f) { Reader(f).check_format("uniphy-x", 1); },
     "f.h5: attribute format: expected \"uniphy-x\", found no such attribute"},
    {"OtherFormat", with_attribute([](Writer& w) { w.attribute("/", "format", "uniphy-y"); }),
     [](const Path& f) { Reader(f).check_format("uniphy-x", 1); },
     "f.h5: attribute format: expected \"uniphy-x\", found \"uniphy-y\""},
    {"NewerVersion", with_attribute([](Writer& w) {
       w.attribute("/", "format", "uniphy-x");
       w.attribute("/", "version", 7);
     }),
     [](const Path& f) { Reader(f).check_format("uniphy-x", 2); },
     "f.h5: attribute version: expected 1 to 2, found 7"},
    {"VersionIsText", with_attribute([](Writer& w) {
       w.attribute("/", "format", "uniphy-x");
       w.attribute("/", "version", "1");
     }),
     [](const Path& f) { Reader(f).check_format("uniphy-x", 1); },
     "f.h5: attribute version: expected an integer, found text"},
    {"AttributeCount", with_attribute([](Writer& w) {
       w.attribute("/", "g", std::vector<double>{1, 2});
     }),
     [](const Path& f) { Reader(f).attribute_reals("/", "g", 3); },
     "f.h5: attribute g: expected 3 values, found 2 values"},
    {"AttributeNotFinite", with_attribute([](Writer& w) { w.attribute("/", "dt", INFINITY); }),
     [](const Path& f) { Reader(f).attribute_real("/", "dt"); },
     "f.h5: attribute dt: expected a finite number, found inf"},
    {"AttributeMissing", with_x(kSix, {2, 3}),
     [](const Path& f) { Reader(f).attribute_text("x", "origin"); },
     "f.h5: attribute origin of /x: expected text, found no such attribute"},
};

INSTANTIATE_TEST_SUITE_P(Files, BadHdf5, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return info.param.name; });

TEST(BadHdf5File, SignatureWithoutAFile) {
  const testing::Scratch scratch;
  const Path file = scratch.write("f.h5", "\x89HDF\r\n\x1a\n");
  EXPECT_THAT(testing::error_of([&] { open_only(file); }),
              HasSubstr("f.h5: cannot be opened as HDF5: "));
}

TEST(BadHdf5File, TruncatedFileSaysSo) {
  const testing::Scratch scratch;
  truncated(scratch.file("f.h5"));
  const std::string message = testing::error_of([&] { read_x(scratch.file("f.h5")); });
  EXPECT_THAT(message, HasSubstr("f.h5: expected a whole HDF5 file, found a truncated one"));
}

// A header may claim anything: nothing of that size may be allocated.
TEST(BadHdf5File, ClaimsBeyondTheFileAreRefused) {
  const testing::Scratch scratch;
  const Path file = scratch.file("f.h5");
  for (const auto& fill : {terabyte_plain, terabyte_chunked, overflowing}) {
    raw(fill)(file);
    const std::string message = testing::error_of([&] { read_x(file); });
    EXPECT_THAT(testing::without_directory(message, scratch.path()),
                StartsWith("f.h5: /x: the shape ["));
    EXPECT_THAT(message, HasSubstr("the file is damaged"));
  }
}

TEST(BadHdf5File, UnreadableFile) {
  if (::geteuid() == 0) GTEST_SKIP() << "root reads every file";
  const testing::Scratch scratch;
  with_x(kSix, {2, 3})(scratch.file("f.h5"));
  std::filesystem::permissions(scratch.file("f.h5"), std::filesystem::perms::none);
  EXPECT_THAT(testing::error_of([&] { read_x(scratch.file("f.h5")); }),
              HasSubstr("cannot be read: Permission denied"));
}

// Every prefix of a good file is refused with an error, never read as something else.
TEST(BadHdf5File, EveryTruncationIsAnError) {
  const testing::Scratch scratch;
  const Path good = scratch.file("good.h5");
  with_x(kSix, {2, 3})(good);
  const std::string bytes = read_text_file(good);
  for (std::size_t size = 0; size < bytes.size(); size += 37) {
    const Path cut = scratch.write("cut.h5", bytes.substr(0, size));
    EXPECT_THAT(testing::error_of([&] { read_x(cut); }), HasSubstr("cut.h5"));
  }
}

}  // namespace
}  // namespace uniphy
