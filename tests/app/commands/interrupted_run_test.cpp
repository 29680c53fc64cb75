// SPDX-License-Identifier: Apache-2.0
//
// The program as a process of its own: killed on the way, twice at once on one folder, and out of
// room for its files.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/app/commands/poses_of_arm.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

class InterruptedRun : public testing::Test {
 protected:
  void SetUp() override { write_poses(arm("interrupted", {}).recording, folder_); }

  [[nodiscard]] fs::path in(const std::string& name) const { return folder_.path() / name; }

  /// `kinescope run` on the recording; files of at most `most_bytes`, 0: of any size.
  [[nodiscard]] pid_t start(const fs::path& output, rlim_t most_bytes = 0) const {
    const std::string recording = folder_.path().string();
    const std::string out = output.string();
    const std::string errors = in("errors.txt").string();
    const pid_t child = ::fork();
    if (child != 0) return child;
    if (::freopen(errors.c_str(), "w", stderr) == nullptr ||
        ::freopen("/dev/null", "w", stdout) == nullptr) {
      ::_exit(127);
    }
    if (most_bytes > 0) {
      const rlimit limit{most_bytes, most_bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    ::execl(KINESCOPE_PROGRAM, "kinescope", "run", recording.c_str(), "--output", out.c_str(),
            "--quiet", static_cast<char*>(nullptr));
    ::_exit(127);
  }

  /// Exit code; -1 where a signal ended it.
  static int wait_for(pid_t child) {
    int status = 0;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  void expect_same_products(const fs::path& a, const fs::path& b) const {
    for (const char* name : {"robot.urdf", "structure.json", "calibration.json", "tracks.csv",
                             "residuals.csv", "joint_values.csv", "trace.json"}) {
      ASSERT_TRUE(fs::exists(a / name) && fs::exists(b / name)) << name;
      EXPECT_EQ(read_text_file(a / name), read_text_file(b / name)) << name;
    }
    for (const auto& entry : fs::directory_iterator(b)) {
      EXPECT_TRUE(fs::exists(a / entry.path().filename())) << entry.path() << " was left behind";
    }
  }

  RecordingFolder folder_;
};

TEST_F(InterruptedRun, TheSameCommandGoesOnAfterAKill) {
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_EQ(wait_for(start(in("whole"))), 0);
  const auto whole = std::chrono::steady_clock::now() - begin;
  int killed = 0;
  for (const double share : {0.2, 0.5, 0.8, 0.9, 0.95, 0.98}) {
    const pid_t child = start(in("cut"));
    std::this_thread::sleep_for(share * whole);
    ::kill(child, SIGKILL);
    if (wait_for(child) == -1) ++killed;
  }
  EXPECT_GT(killed, 0);
  ASSERT_EQ(wait_for(start(in("cut"))), 0);
  expect_same_products(in("whole"), in("cut"));
}

TEST_F(InterruptedRun, TwoAtOnceOnOneFolder) {
  ASSERT_EQ(wait_for(start(in("alone"))), 0);
  const pid_t first = start(in("shared"));
  const pid_t second = start(in("shared"));
  EXPECT_EQ(wait_for(first), 0);
  EXPECT_EQ(wait_for(second), 0);
  expect_same_products(in("alone"), in("shared"));
}

TEST_F(InterruptedRun, WithoutRoomItSaysSoAndKeepsWhatWasThere) {
  ASSERT_EQ(wait_for(start(in("out"))), 0);
  const std::string urdf = read_text_file(in("out") / "robot.urdf");
  EXPECT_EQ(wait_for(start(in("out"), 2000)), static_cast<int>(ExitCode::kBadRequest));
  const std::string line = read_text_file(in("errors.txt"));
  EXPECT_NE(line.find("cannot be written"), std::string::npos) << line;
  EXPECT_NE(line.find("the disk is not full"), std::string::npos) << line;
  EXPECT_EQ(std::ranges::count(line, '\n'), 1) << line;
  EXPECT_EQ(read_text_file(in("out") / "robot.urdf"), urdf);
}

}  // namespace
}  // namespace kinescope
