// SPDX-License-Identifier: Apache-2.0
//
// The program as a function: exit codes, one line for an error, help that a newcomer can use.
#include "app/commands/cli.h"

#include <cstdio>
#include <iostream>
#include <string>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/app/commands/program.h"
#include "tests/app/io/recording_folder.h"

namespace kinescope {
namespace {

TEST(Cli, VersionAndHelp) {
  const Outcome version = run({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_TRUE(version.out.starts_with("kinescope ")) << version.out;
  for (const std::string command : {"run", "dynamics", "contact", "inspect", "camera", "markers"}) {
    const Outcome help = run({command, "--help"});
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find(":\n  kinescope " + command), std::string::npos) << help.out;
    EXPECT_NE(help.out.find("Exit codes:"), std::string::npos);
    EXPECT_EQ(help.err, "");
  }
  EXPECT_NE(run({"--help"}).out.find("inspect"), std::string::npos);
}

TEST(Cli, OutputThatCannotBeWritten) {
  const int full = ::open("/dev/full", O_WRONLY);
  if (full < 0) GTEST_SKIP() << "no /dev/full on this machine";
  std::fflush(stdout);
  const int before = ::dup(STDOUT_FILENO);
  ::dup2(full, STDOUT_FILENO);
  testing::internal::CaptureStderr();
  const char* const argv[] = {"kinescope", "--version", nullptr};
  const int code = run_program(2, argv);
  std::clearerr(stdout);
  std::cout.clear();
  ::dup2(before, STDOUT_FILENO);
  ::close(before);
  ::close(full);
  EXPECT_EQ(code, static_cast<int>(ExitCode::kBadRequest));
  EXPECT_TRUE(testing::internal::GetCapturedStderr().starts_with(
      "kinescope: standard output: cannot be written"));
}

TEST(Cli, WrongCommandLines) {
  const ExitCode code = ExitCode::kBadRequest;
  expect_refusal({}, code, "name a command");
  expect_refusal({"rnu"}, code, "'rnu' is no command (did you mean 'run'?");
  expect_refusal({"rnu", "--help"}, code, "'rnu' is no command (did you mean 'run'?");
  expect_refusal({"--frobnicate"}, code, "name a command");
  expect_refusal({"run"}, code, "RECORDING");
  expect_refusal({"run", "x", "--outptu", "y"}, code,
                 "--outptu is no option of run (did you mean '--output'?");
  expect_refusal({"inspect", "x", "y"}, code, "see kinescope inspect --help");
  expect_refusal({"run", "x", "--free", "everything"}, code, "'everything' is not known");
  expect_refusal({"run", "x", "--threads", "0"}, code, "'0' is not a number from 1 to 256");
  expect_refusal({"run", "x", "--decimate", "nan"}, code, "'nan' is not a number");
  expect_refusal({"run", "x", "--folds", "many"}, code, "'many'");
  expect_refusal({"run", "x", "--output", ""}, code, "--output: is empty");
  expect_refusal({"dynamics", "x", "--robot", ""}, code, "--robot: is empty");
  expect_refusal({"camera", "x"}, code, "--board");
  expect_refusal({"markers", "--ids", "0-3"}, code, "--size");
  expect_refusal({"markers", "--ids", "3-0", "--size", "0.04"}, code, "names no markers");
  expect_refusal({"markers", "--ids", "0-9999999", "--size", "0.04"}, code, "names no markers");
  expect_refusal({"markers", "--ids", "0", "--size", "40"}, code, "no length in m");
  expect_refusal({"markers", "--ids", "0", "--size", "0.4"}, code, "does not fit on A4");
  expect_refusal({"markers", "--ids", "587", "--size", "0.04"}, code, "has no marker 587");
  expect_refusal({"markers", "--ids", "0", "--size", "0.04", "--family", "tag"}, code,
                 "no such marker family");
  expect_refusal(
      {"camera", "x", "--board", "chessboard", "--columns", "9", "--rows", "6", "--square", "25"},
      code, "'25' is no length in m");
  expect_refusal(
      {"camera", "x", "--board", "chess", "--columns", "9", "--rows", "6", "--square", "0.025"},
      code, "'chess' is not known");
}

TEST(Cli, ErrorsOfCommandsGiveTheirCode) {
  expect_refusal({"run", "no/such/folder"}, ExitCode::kBadInput, "no/such/folder: no such folder");
  expect_refusal({"run", "no/such/folder", "--video", "a", "--poses", "b"}, ExitCode::kBadInput,
                 "no such folder");
  expect_refusal({"camera", "no/such/images", "--board", "chessboard", "--columns", "9", "--rows",
                  "6", "--square", "0.025"},
                 ExitCode::kBadInput, "no/such/images");
}

TEST(Cli, InspectEndsWithThreeAndNamesTheProblem) {
  const Outcome outcome = run({"inspect", "no/such/folder", "--quiet"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.out.find("no such folder"), std::string::npos);
  EXPECT_EQ(outcome.err, "");
}

TEST(Cli, NothingIsWrittenForABadRecording) {
  const RecordingFolder folder;
  folder.write("video.mp4", "no video").write("tags.yaml", "default_size: -1\n");
  const std::filesystem::path output = folder.path() / "out";
  expect_refusal({"run", folder.path().string(), "--output", output.string(), "--quiet"},
                 ExitCode::kBadInput, "tags.yaml:1: default_size is -1");
  EXPECT_FALSE(std::filesystem::exists(output));
}

}  // namespace
}  // namespace kinescope
