// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/file.h"

#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "kinematics/core/error.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {
namespace fs = std::filesystem;

class FileTest : public testing::Test {
 protected:
  FileTest() { fs::create_directories(folder_); }
  ~FileTest() override { fs::remove_all(folder_); }
  fs::path folder_ = truth::temporary_path("file_test");
};

ExitCode code_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.code();
  }
  return ExitCode::kDone;
}

TEST_F(FileTest, WritesWholeFilesAndReadsThem) {
  const std::string content("a\0b\r\n", 5);
  write_file_atomically(folder_ / "a.bin", content);
  EXPECT_EQ(read_text_file(folder_ / "a.bin"), content);
  write_file_atomically(folder_ / "a.bin", "");
  EXPECT_EQ(read_text_file(folder_ / "a.bin"), "");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1) << "no temporary file is left";
}

TEST_F(FileTest, WritesSeveralOrNone) {
  write_file_atomically(folder_ / "a", "before");
  fs::create_directory(folder_ / "b");
  EXPECT_EQ(code_of([&] {
              write_files_atomically({{folder_ / "a", "after"}, {folder_ / "b", "a folder"}});
            }),
            ExitCode::kBadRequest);
  EXPECT_EQ(read_text_file(folder_ / "a"), "before");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 2) << "no temporary file is left";
  write_files_atomically({{folder_ / "a", "after"}, {folder_ / "c", "new"}});
  EXPECT_EQ(read_text_file(folder_ / "a"), "after");
  EXPECT_EQ(read_text_file(folder_ / "c"), "new");
}

TEST_F(FileTest, RemovesWhatAProcessThatIsGoneWasWriting) {
  constexpr int kNoProcess = 2147483647;  // beyond the largest that Linux gives
  const fs::path gone = folder_ / fmt::format(".a.csv.{}.tmp", kNoProcess);
  const std::vector<fs::path> kept{
      folder_ / "a.csv",
      folder_ / fmt::format(".a.csv.{}.tmp", ::getpid()),
      folder_ / fmt::format(".b.csv.{}.tmp", kNoProcess),
      folder_ / ".a.csv.tmp",
      folder_ / ".a.csv.12x.tmp",
  };
  for (const fs::path& path : kept) write_file_atomically(path, "kept");
  write_file_atomically(gone, "half");
  remove_abandoned(folder_, {"a.csv", "c.csv"});
  EXPECT_FALSE(fs::exists(gone));
  for (const fs::path& path : kept) EXPECT_TRUE(fs::exists(path)) << path;
  EXPECT_NO_THROW(remove_abandoned(folder_ / "nowhere", {"a.csv"}));
}

TEST_F(FileTest, ReplacesNoPipe) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(code_of([&] { write_file_atomically(pipe, "x"); }), ExitCode::kBadRequest);
  EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST_F(FileTest, RefusesWhatCannotBeRead) {
  EXPECT_EQ(code_of([&] { static_cast<void>(read_text_file(folder_ / "none")); }),
            ExitCode::kBadInput);
  EXPECT_EQ(code_of([&] { static_cast<void>(read_text_file(folder_)); }), ExitCode::kBadInput);
  write_file_atomically(folder_ / "big", "12345");
  EXPECT_EQ(code_of([&] { static_cast<void>(read_text_file(folder_ / "big", 4)); }),
            ExitCode::kBadInput);
  EXPECT_EQ(read_text_file(folder_ / "big", 5), "12345");
}

TEST_F(FileTest, WaitsForNoPipeAndReadsNoDevice) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  fs::create_symlink(folder_ / "nowhere", folder_ / "dangling");
  fs::create_symlink(folder_ / "loop", folder_ / "loop");
  for (const fs::path& path : {folder_ / "pipe", fs::path("/dev/zero"), fs::path("/dev/null"),
                               folder_ / "dangling", folder_ / "loop"}) {
    EXPECT_EQ(code_of([&] { static_cast<void>(read_text_file(path)); }), ExitCode::kBadInput)
        << path;
  }
  fs::create_symlink(folder_ / "a", folder_ / "link");
  write_file_atomically(folder_ / "a", "12345");
  EXPECT_EQ(read_text_file(folder_ / "link"), "12345");
}

TEST_F(FileTest, BoundsFilesThatTellNoSize) {
  const fs::path no_size = "/proc/self/status";
  if (!fs::exists(no_size)) GTEST_SKIP();
  EXPECT_FALSE(read_text_file(no_size).empty());
  EXPECT_EQ(code_of([&] { static_cast<void>(read_text_file(no_size, 10)); }), ExitCode::kBadInput);
}

TEST_F(FileTest, RefusesWhatCannotBeWritten) {
  EXPECT_EQ(code_of([&] { write_file_atomically(folder_ / "none" / "a", "x"); }),
            ExitCode::kBadRequest);
  fs::create_directories(folder_ / "taken" / "inside");
  EXPECT_EQ(code_of([&] { write_file_atomically(folder_ / "taken", "x"); }), ExitCode::kBadRequest);
  EXPECT_TRUE(fs::is_directory(folder_ / "taken")) << "nothing is overwritten";
  write_file_atomically(folder_ / "file", "x");
  EXPECT_EQ(code_of([&] { require_writable_folder(folder_ / "file" / "out"); }),
            ExitCode::kBadRequest);
  require_writable_folder(folder_ / "new" / "out");
  EXPECT_TRUE(fs::is_empty(folder_ / "new" / "out")) << "the proof leaves nothing behind";
}

}  // namespace
}  // namespace kinescope
