// SPDX-License-Identifier: Apache-2.0
//
// A recording's folder made for one test, and the message that reading it ends with.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "app/io/recording.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {

/// A temporary folder, removed at the end. Begins as a recording that enters by poses.csv, which
/// needs nothing else.
class RecordingFolder {
 public:
  RecordingFolder() {
    const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ = truth::temporary_path(std::string(test->test_suite_name()) + "_" + test->name());
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~RecordingFolder() { std::filesystem::remove_all(path_); }
  RecordingFolder(const RecordingFolder&) = delete;
  RecordingFolder& operator=(const RecordingFolder&) = delete;

  const RecordingFolder& write(const std::string& name, std::string_view text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    write_file_atomically(path_ / name, text);
    return *this;
  }
  void remove(const std::string& name) const { std::filesystem::remove_all(path_ / name); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] RecordingPaths paths() const {
    RecordingPaths paths;
    paths.folder = path_;
    return paths;
  }

  /// The message of the Error that `call` ends with, the folder's path left out; "accepted" without
  /// one.
  template <typename Call>
  [[nodiscard]] std::string refusal_of(Call call, ExitCode code = ExitCode::kBadInput) const {
    try {
      call();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      std::string message = error.what();
      EXPECT_EQ(message.find('\n'), std::string::npos) << "one line: " << message;
      EXPECT_TRUE(message.ends_with(")")) << "a remedy: " << message;
      for (std::size_t at = 0; (at = message.find(path_.string() + "/")) != std::string::npos;) {
        message.erase(at, path_.string().size() + 1);
      }
      return message;
    }
    return "accepted";
  }

  [[nodiscard]] std::string refusal(ExitCode code = ExitCode::kBadInput) const {
    return refusal_of([this] { static_cast<void>(read_recording(paths())); }, code);
  }

 private:
  std::filesystem::path path_;
};

}  // namespace kinescope
