#include "uniphy/io/atomic_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

TEST(AtomicFile, WritesReplacesAndReads) {
  const testing::Scratch scratch;
  const auto file = scratch.file("a.txt");
  write_text_file(file, "one\n");
  write_text_file(file, std::string("two\0\n", 5));
  EXPECT_EQ(read_text_file(file), std::string("two\0\n", 5));
  EXPECT_FALSE(std::filesystem::exists(temporary_name(file)));
}

TEST(AtomicFile, RefusesWhatIsNotAFile) {
  const testing::Scratch scratch;
  const auto message = [&](auto function) {
    return testing::without_directory(testing::error_of(function), scratch.path());
  };
  scratch.write("long.txt", std::string(1000, 'x'));
  EXPECT_EQ(message([&] { read_text_file(scratch.file("long.txt"), 999); }),
            "long.txt: expected at most 999 bytes, found more");
  EXPECT_EQ(read_text_file(scratch.file("long.txt"), 1000).size(), 1000u);
  EXPECT_EQ(message([&] { read_text_file(scratch.file("none.txt")); }),
            "none.txt: expected a file, found nothing of that name");
  EXPECT_EQ(message([&] { write_text_file(scratch.file("none/a.txt"), ""); }),
            "none/a.txt: cannot be written: No such file or directory");
}

TEST(AtomicFile, FullDiskIsAnErrorAndTheOldFileStays) {
  if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
  const testing::Scratch scratch;
  const auto file = scratch.write("a.txt", "old");
  std::filesystem::create_symlink("/dev/full", temporary_name(file));
  EXPECT_EQ(testing::without_directory(
                testing::error_of([&] { write_text_file(file, std::string(100000, 'x')); }),
                scratch.path()),
            "a.txt: cannot be written: No space left on device");
  EXPECT_EQ(read_text_file(file), "old");
}

TEST(AtomicFile, MakesDirectories) {
  const testing::Scratch scratch;
  make_directory(scratch.file("a/b/c"));
  make_directory(scratch.file("a/b/c"));
  EXPECT_TRUE(std::filesystem::is_directory(scratch.file("a/b/c")));
  scratch.write("file", "");
  EXPECT_EQ(testing::without_directory(
                testing::error_of([&] { make_directory(scratch.file("file")); }), scratch.path()),
            "file: expected a directory, found a file of that name");
  EXPECT_FALSE(testing::error_of([&] { make_directory(scratch.file("file/below")); }).empty());
}

TEST(AtomicFile, NamesThatAreTooLongAreErrors) {
  const testing::Scratch scratch;
  const auto name = scratch.file(std::string(300, 'n'));
  EXPECT_EQ(testing::error_of([&] { make_directory(name); }),
            name.string() + ": cannot be made: File name too long");
  EXPECT_EQ(testing::error_of([&] { write_text_file(name, "text"); }),
            name.string() + ": cannot be written: File name too long");
}

}  // namespace
}  // namespace uniphy
