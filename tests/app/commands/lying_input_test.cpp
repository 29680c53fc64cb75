// SPDX-License-Identifier: Apache-2.0
//
// Input that is bad or lies, one row a case: what is changed in a sound recording, the command, the
// exit code, the words that must be said and those that would lead astray. A refusal is one line
// with a remedy, and leaves every file as it was. The tables are in lying_input.
#include <algorithm>
#include <filesystem>
#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/file.h"
#include "tests/app/commands/folder_contents.h"
#include "tests/app/commands/lying_input/changes.h"
#include "tests/app/commands/lying_input/sound_recordings.h"
#include "tests/app/commands/program.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using lying::Files;
using lying::kDynamics;
using lying::kInspect;
using lying::kPredict;
using lying::kRun;
using lying::LyingInput;
using lying::Words;

void expect_one_line(const Outcome& outcome) {
  std::string line = outcome.err;
  while (line.starts_with("warning: ")) line.erase(0, line.find('\n') + 1);
  EXPECT_TRUE(line.starts_with("kinescope: ")) << outcome.err;
  EXPECT_EQ(std::ranges::count(line, '\n'), 1) << outcome.err;
  EXPECT_TRUE(line.ends_with(")\n")) << "a remedy: " << outcome.err;
  EXPECT_EQ(outcome.out, "");
}

Outcome run_in(const fs::path& folder, Words command) {
  for (std::string& word : command) {
    if (word.starts_with("{d}")) word.replace(0, 3, folder.string());
  }
  return run(command);
}

class LyingInputs : public testing::TestWithParam<LyingInput> {
 protected:
  static fs::path folder_of(const LyingInput& input) {
    return truth::temporary_path(fmt::format("lying_input_{}", input.name));
  }
};

TEST_P(LyingInputs, AreNamed) {
  const LyingInput& input = GetParam();
  Files files = input.sound();
  input.change(files);
  const fs::path folder = folder_of(input);
  fs::remove_all(folder);
  for (const auto& [name, text] : files) {
    fs::create_directories((folder / name).parent_path());
    write_file_atomically(folder / name, text);
  }
  const Outcome outcome = run_in(folder, input.command);
  const std::string said = outcome.err + outcome.out;
  EXPECT_EQ(outcome.code, input.code) << said;
  for (const std::string& part : input.says) {
    EXPECT_NE(said.find(part), std::string::npos) << "'" << part << "' is not in: " << said;
  }
  for (const std::string& part : input.silent) {
    EXPECT_EQ(said.find(part), std::string::npos) << "'" << part << "' is in: " << said;
  }
  const Files after = contents(folder);
  for (const auto& [name, text] : files) {
    EXPECT_TRUE(after.contains(name) && after.at(name) == text) << name << " was touched";
  }
  if (input.code != 0) {
    expect_one_line(outcome);
    // What was seen is kept for the next run where the search for an answer had begun.
    const std::set<std::string> seen{"out/tracks.csv", "out/.kinescope_products"};
    for (const auto& [name, text] : after) {
      EXPECT_TRUE(files.contains(name) || seen.contains(name)) << name << " was left behind";
    }
  }
  fs::remove_all(folder);
}

std::string name_of(const testing::TestParamInfo<LyingInput>& test) { return test.param.name; }

INSTANTIATE_TEST_SUITE_P(Logs, LyingInputs, testing::ValuesIn(lying::lying_logs()), name_of);
INSTANTIATE_TEST_SUITE_P(Sightings, LyingInputs, testing::ValuesIn(lying::lying_sightings()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Settings, LyingInputs, testing::ValuesIn(lying::lying_settings()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Drawings, LyingInputs, testing::ValuesIn(lying::lying_drawings()),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Torques, LyingInputs, testing::ValuesIn(lying::lying_torques()), name_of);

// What the table's changes are made to is sound: without a change nothing is refused.
TEST(SoundInputs, AreTaken) {
  for (const auto& [sound, command] :
       std::vector<std::pair<const Files& (*)(), Words>>{{lying::poses, kRun},
                                                         {lying::corners, kInspect},
                                                         {lying::nominal, kInspect},
                                                         {lying::torques, kDynamics},
                                                         {lying::torques, kPredict}}) {
    const fs::path folder = truth::temporary_path("lying_input_sound");
    fs::remove_all(folder);
    fs::create_directories(folder);
    for (const auto& [name, text] : sound()) write_file_atomically(folder / name, text);
    const Outcome outcome = run_in(folder, command);
    EXPECT_EQ(outcome.code, 0) << command.front() << ": " << outcome.err << outcome.out;
    EXPECT_EQ(outcome.err.find("warning"), std::string::npos) << outcome.err;
    fs::remove_all(folder);
  }
}

// The advice for exchanged torque columns works.
TEST(LyingTorques, TheAdviceForExchangedColumnsPutsThemRight) {
  Files files = lying::torques();
  lying::columns_exchanged("log.csv", "tau1", "tau2")(files);
  files["recording.yaml"] = "dynamics: {torque: [tau2, tau1, tau3]}\n";
  const fs::path folder = truth::temporary_path("lying_input_advice");
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [name, text] : files) write_file_atomically(folder / name, text);
  const Outcome outcome = run_in(folder, kDynamics);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  fs::remove_all(folder);
}

}  // namespace
}  // namespace kinescope
