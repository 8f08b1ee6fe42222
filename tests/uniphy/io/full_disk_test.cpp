#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/uniphy/support/limits.hpp"
#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/data/part_file.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/seal.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {
namespace {

using testing::error_with_room_for;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Every way to write: whole datasets, plain and compressed, text, attributes, and rows that are
/// appended; more than HDF5 keeps in its caches.
void write_all(const std::filesystem::path& file, bool sealed) {
  const std::vector<double> numbers(20000, 0.5);
  std::vector<double> noise;
  for (int k = 0; k < 20000; ++k) noise.push_back(k * 0.618 - int(k * 0.618));
  hdf5::Writer writer(file);
  writer.attribute("/", "config", std::string(20000, 'c'));
  writer.write("small", std::vector<double>{1, 2, 3}, {3}, {"m", "small"});
  writer.write("group/plain", numbers, {20000}, {"m", "plain"});
  writer.write("group/packed", noise, {20000}, {"m", "packed", 4});
  writer.write_strings("names", std::vector<std::string>(500, "name"), {"1", "names"});
  writer.extendible<double>("rows", {10}, {"m", "rows"});
  for (int k = 0; k < 20; ++k) writer.append("rows", numbers.data(), 100);
  sealed ? writer.commit_sealed() : writer.commit();
}

TEST(FullDisk, AnHdf5FileIsWholeOrNotThere) {
  const testing::Scratch scratch;
  write_all(scratch.file("whole.h5"), true);
  const auto size = std::filesystem::file_size(scratch.file("whole.h5"));
  ASSERT_GT(size, 400000u);
  const auto file = scratch.write("f.h5", "old");
  for (std::size_t room = 0; room < size; room += size / 60) {
    const std::string message = error_with_room_for(room, [&] { write_all(file, room % 2 == 0); });
    ASSERT_THAT(message, StartsWith(file.string() + ": ")) << room;
    EXPECT_THAT(message, HasSubstr("File too large")) << room;
    EXPECT_EQ(read_text_file(file), "old") << room;
    EXPECT_FALSE(std::filesystem::exists(temporary_name(file))) << room;
  }
  // The last bytes are those of the seal.
  const std::string message = error_with_room_for(size - 1, [&] { write_all(file, true); });
  EXPECT_EQ(message, file.string() + ": cannot be written: File too large");
  EXPECT_EQ(error_with_room_for(size, [&] { write_all(file, true); }), "");
  EXPECT_EQ(read_text_file(file), read_text_file(scratch.file("whole.h5")));
}

TEST(FullDisk, ATextFileIsWholeOrNotThere) {
  const testing::Scratch scratch;
  const auto file = scratch.write("f.txt", "old");
  const std::string text(100000, 'x');
  for (const std::size_t room :
       {std::size_t{0}, std::size_t{1}, std::size_t{4096}, text.size() - 1}) {
    EXPECT_EQ(error_with_room_for(room, [&] { write_text_file(file, text); }),
              file.string() + ": cannot be written: File too large");
    EXPECT_EQ(read_text_file(file), "old");
    EXPECT_FALSE(std::filesystem::exists(temporary_name(file)));
  }
  EXPECT_EQ(error_with_room_for(text.size(), [&] { write_text_file(file, text); }), "");
  EXPECT_EQ(read_text_file(file), text);
}

TEST(FullDisk, APictureIsWholeOrNotThere) {
  if (!gnuplot_available()) GTEST_SKIP() << "no gnuplot";
  const testing::Scratch scratch;
  Chart chart;
  chart.title = "a curve";
  chart.series.emplace_back();
  chart.series[0].x = {0, 1, 2, 3};
  chart.series[0].y = {1, 5, 2, 8};
  const auto draw = [&](const std::filesystem::path& file) { plot_chart(file, chart); };
  draw(scratch.file("whole.png"));
  const auto size = std::filesystem::file_size(scratch.file("whole.png"));
  const auto file = scratch.file("f.png");
  for (const std::size_t room : {size / 2, size - 1}) {
    EXPECT_THAT(error_with_room_for(room, [&] { draw(file); }),
                StartsWith(file.string() + ": cannot be written"));
    EXPECT_FALSE(std::filesystem::exists(file));
  }
}

TEST(Seal, RefusesEveryChange) {
  const testing::Scratch scratch;
  const auto file = scratch.file("state.bin");
  const std::string bytes("some\0bytes\n", 11);
  write_sealed_file(file, bytes);
  EXPECT_EQ(read_sealed_file(file), bytes);
  const std::string whole = read_text_file(file);
  const std::string refused =
      file.string() + ": the file is damaged: its checksum does not fit; remove it to start anew";
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string changed = whole;
    changed[bit / 8] = static_cast<char>(changed[bit / 8] ^ (1 << bit % 8));
    scratch.write("state.bin", changed);
    EXPECT_EQ(testing::error_of([&] { read_sealed_file(file); }), refused) << bit;
  }
  for (std::size_t length = 0; length < whole.size(); ++length) {
    scratch.write("state.bin", whole.substr(0, length));
    EXPECT_EQ(testing::error_of([&] { check_seal(file); }), refused) << length;
  }
}

TEST(Seal, ASealedHdf5FileIsReadAsBefore) {
  const testing::Scratch scratch;
  write_all(scratch.file("f.h5"), true);
  check_seal(scratch.file("f.h5"));
  const hdf5::Reader reader(scratch.file("f.h5"));
  EXPECT_EQ(reader.read<double>("small", {3}), (std::vector<double>{1, 2, 3}));
}

TEST(PartFile, RefusesDamage) {
  const testing::Scratch scratch;
  const auto file = scratch.file("000000.h5");
  TrajectoryPart part;
  part.samples.F.assign(900, 1);
  part.samples.F_proj = part.samples.C = part.samples.tau = part.samples.F;
  part.samples.source.assign(100, 0);
  write_part(file, part);
  ASSERT_TRUE(read_part(file).has_value());
  const std::string whole = read_text_file(file);
  // Zeros in place of data, as a disk that was full would leave them.
  std::string changed = whole;
  const std::size_t middle = changed.find(std::string("\0\0\0\0\0\0\xf0\x3f", 8));
  ASSERT_NE(middle, changed.npos);
  changed.replace(middle, 800, 800, '\0');
  scratch.write("000000.h5", changed);
  EXPECT_THAT(testing::error_of([&] { read_part(file); }), HasSubstr("its checksum does not fit"));
  // Whole, but not a number: left by a run that went wrong.
  part.samples.tau[17] = std::numeric_limits<double>::quiet_NaN();
  write_part(file, part);
  EXPECT_THAT(testing::error_of([&] { read_part(file); }),
              HasSubstr("/tau: expected finite numbers, found nan at position 17"));
}

}  // namespace
}  // namespace uniphy
