// SPDX-License-Identifier: Apache-2.0
//
// `kinescope trace` and `kinescope correct`: what they refuse, and a log that is corrected.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/io/effects_file.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/recording_folder.h"

namespace kinescope {
namespace {

using nlohmann::json;

class TraceRefusals : public testing::Test {
 protected:
  void refused(const std::string& part, ExitCode code = ExitCode::kBadInput) const {
    expect_refusal({"trace", folder_.path().string(), "--quiet"}, code, part);
  }
  void refused(const json& run, const std::string& part) const {
    folder_.write("run.json", run.dump());
    refused(part);
  }
  [[nodiscard]] json run_of(const std::vector<std::string>& arguments) const {
    return {{"schema", "kinescope.run"},
            {"arguments", arguments},
            {"working_folder", folder_.path().string()}};
  }
  RecordingFolder folder_;
};

TEST_F(TraceRefusals, AFolderWithoutARun) {
  refused("run.json");
  expect_refusal({"trace", (folder_.path() / "nowhere").string()}, ExitCode::kBadInput,
                 "nowhere/run.json");
  expect_refusal({"trace"}, ExitCode::kBadRequest, "RUN_FOLDER");
}

TEST_F(TraceRefusals, ARunThatDoesNotSayHowItWasStarted) {
  const json whole = run_of({"run", "somewhere"});
  folder_.write("run.json", whole.dump().substr(0, 30));
  refused("does not say how the run was started");
  refused(json::array(), "does not say how the run was started");
  for (const char* key : {"schema", "arguments", "working_folder"}) {
    json run = whole;
    run.erase(key);
    refused(run, "does not say how the run was started");
    run[key] = 3;
    refused(run, "does not say how the run was started");
  }
  refused(run_of({}), "does not say how the run was started");
}

TEST_F(TraceRefusals, AFolderOfAnotherCommand) {
  refused(run_of({"inspect", "somewhere"}), "no folder of kinescope run");
  refused(run_of({"run", "somewhere", "--no-such-option"}), "not understood");
}

TEST_F(TraceRefusals, ARecordingThatIsNoLongerThere) {
  refused(run_of({"run", "moved_away"}), "moved_away");
}

// A finished run of two hinges, the second of which has an encoder out of scale.
class Correct : public testing::Test {
 protected:
  Correct() {
    KinematicTree tree;
    tree.links = {{"base"}, {"upper"}, {"fore"}};
    for (int j = 0; j < 2; ++j) {
      Joint joint;
      joint.name = fmt::format("joint{}", j + 1);
      joint.type = JointType::kRevolute;
      joint.parent = LinkId{j};
      joint.child = LinkId{j + 1};
      joint.T_parent_joint.translation = {0.2, 0.0, 0.1};
      tree.joints.push_back(joint);
    }
    folder_.write("out/robot.urdf", write_urdf(tree));
    FittedEffect scale;
    scale.id = {"encoder_scale", "joint2"};
    scale.parameters = {{"scale", ""}};
    scale.values = Eigen::VectorXd::Constant(1, 0.01);
    scale.references = Eigen::VectorXd::Ones(1);
    calibration_ = {{"schema", "kinescope.calibration"},
                    {"schema_version", 1},
                    {"robot",
                     {{"joints",
                       {{{"name", "joint1"}, {"channel", "a"}, {"scale", 1.0}, {"offset", 0.0}},
                        {{"name", "joint2"}, {"channel", "b"}, {"scale", 0.5}, {"offset", 0.2}}}}}},
                    {"effects", effects_json({scale})}};
    write_calibration();
    folder_.write("new.csv", "t,a,b\n0,0.1,2\n0.1,0.2,4\n0.2,0.3,6\n");
  }

  void write_calibration() const { folder_.write("out/calibration.json", calibration_.dump(1)); }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> command() const {
    return {"correct", path("out"), path("new.csv"), "--output", path("corrected.csv")};
  }
  void refused(ExitCode code, const std::string& part) const {
    expect_refusal(command(), code, part);
    EXPECT_FALSE(std::filesystem::exists(path("corrected.csv")));
  }

  RecordingFolder folder_;
  json calibration_;
};

TEST_F(Correct, UndoesWhatTheRunFound) {
  const Outcome outcome = run(command());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("Undone: encoder_scale at joint2."), std::string::npos);
  const JointLog log = read_joint_log(path("corrected.csv"));
  ASSERT_EQ(log.values.rows(), 3);
  // Of 0.5 x 4 + 0.2 = 2.2 rad 1 % are 0.022 rad, 0.044 of the channel's units.
  EXPECT_NEAR(log.values(1, 1), 4.044, 1e-12);
  EXPECT_EQ(log.values(1, 0), 0.2);
}

// The run took the second channel in degrees: the scale of 0.5 is of the reading in rad.
TEST_F(Correct, KeepsToTheUnitsOfTheRecording) {
  calibration_["unit_factors"] = {{"b", kRadPerDegree}};
  write_calibration();
  folder_.write("new.csv", "t,a,b\n0,0.1,114.6\n0.1,0.2,229.2\n0.2,0.3,343.8\n");
  const Outcome outcome = run(command());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const JointLog log = read_joint_log(path("corrected.csv"));
  // 0.5 x 229.2 deg + 0.2 rad: 1 % of it, in degrees, over 0.5.
  EXPECT_NEAR(log.values(1, 1), 229.2 + 0.01 * (229.2 + 0.4 / kRadPerDegree), 1e-9);
  EXPECT_EQ(log.values(1, 0), 0.2);
  calibration_["unit_factors"] = {{"b", 0.0}};
  write_calibration();
  folder_.remove("corrected.csv");
  refused(ExitCode::kBadInput, "unit_factors");
}

TEST_F(Correct, SaysItToAProgram) {
  std::vector<std::string> words = command();
  words.emplace_back("--json");
  folder_.write("new.csv", "t,a,b\n0,0.1,2\n0.1,0.2,4\n0.1,0.2,4\n");
  const Outcome outcome = run(words);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json said = json::parse(outcome.out);
  EXPECT_EQ(said.at("undone"), json::parse(R"([{"effect": "encoder_scale", "place": "joint2"}])"));
  EXPECT_TRUE(said.at("left").empty());
  ASSERT_EQ(said.at("warnings").size(), 1U);
  EXPECT_EQ(said.at("log"), path("corrected.csv"));
}

TEST_F(Correct, SaysWhatALogCannotShow) {
  calibration_["effects"][0]["effect"] = "helical";
  write_calibration();
  const Outcome outcome = run(command());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("A joint log cannot show: helical at joint2."), std::string::npos)
      << outcome.out;
  EXPECT_EQ(read_joint_log(path("corrected.csv")).values, read_joint_log(path("new.csv")).values);
}

// Torques, words and blanks are none of its business: only what is corrected changes, in its place.
TEST_F(Correct, KeepsTheOtherColumns) {
  folder_.write("new.csv",
                "tau0,b,t,mode,a,temperature\n1.50,2,0,AUTO,0.10,\n-2e0,4.0,0.10,,0.20,nan\n"
                "3,6,0.2,MAN,0.30,41\n");
  ASSERT_EQ(run(command()).code, 0);
  EXPECT_EQ(read_text_file(path("corrected.csv")),
            "tau0,b,t,mode,a,temperature\n1.50,2.024,0,AUTO,0.10,\n-2e0,4.044,0.10,,0.20,nan\n"
            "3,6.064,0.2,MAN,0.30,41\n");
}

// Of the channels seen from 0.1 to 0.5 and from 2 to 6.
TEST_F(Correct, SaysWhatTheRunHasNotSeen) {
  calibration_["robot"]["joints"][0]["range"] = {0.1, 0.5};
  calibration_["robot"]["joints"][1]["range"] = {1.2, 3.2};
  write_calibration();
  const Outcome within = run(command());
  EXPECT_EQ(within.code, 0) << within.err;
  EXPECT_EQ(within.err, "");
  std::vector<std::string> words = command();
  words.insert(words.end(), {"--force", "--quiet"});
  folder_.write("new.csv", "t,a,b\n0,50.1,2\n0.1,50.2,4\n0.2,50.3,8\n");
  const Outcome beyond = run(words);
  EXPECT_EQ(beyond.code, 0) << beyond.err;
  EXPECT_NE(beyond.err.find("column 'a' takes joint1 from 50.1 to 50.3 rad, the run saw 0.1 to "
                            "0.5 rad"),
            std::string::npos)
      << beyond.err;
  EXPECT_NE(beyond.err.find("column 'b' takes joint2 from 1.2 to 4.2 rad"), std::string::npos)
      << beyond.err;
  folder_.remove("corrected.csv");
  folder_.write("new.csv", "t,a,b\n0,6,2\n0.1,20,4\n0.2,28,6\n");
  refused(ExitCode::kBadInput, "these are degrees");
}

// joint2 goes to 3.2 rad; 1.2 to 3 were seen.
TEST_F(Correct, SaysWhereAnEffectFadesOut) {
  calibration_["robot"]["joints"][1]["range"] = {1.2, 3.0};
  calibration_["effects"][0]["range"] = {1.2, 3.0};
  write_calibration();
  const Outcome outcome = run(command());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "warning: " + path("new.csv") +
                             ": joint2 moves to 3.2 rad, beyond the 1.2 to 3 rad in which "
                             "encoder_scale at joint2 was seen: faded out there\n");
  const JointLog log = read_joint_log(path("corrected.csv"));
  EXPECT_NEAR(log.values(0, 1), 2.024, 1e-12);
  EXPECT_NEAR(log.values(1, 1), 4.044, 1e-12);
  const double s = 0.2 / (0.25 * 1.8);
  EXPECT_NEAR(log.values(2, 1), 6.0 + 0.064 * (1.0 - 3.0 * s * s + 2.0 * s * s * s), 1e-12);
  // Far beyond it stays as logged. One line a joint.
  folder_.write("new.csv", "t,a,b\n0,0.1,2\n0.1,0.2,4\n0.2,0.3,9.7\n");
  std::vector<std::string> words = command();
  words.insert(words.end(), {"--force", "--json"});
  const Outcome far = run(words);
  ASSERT_EQ(far.code, 0) << far.err;
  EXPECT_EQ(json::parse(far.out).at("warnings").size(), 1U);
  EXPECT_EQ(read_joint_log(path("corrected.csv")).values(2, 1), 9.7);
}

// The reader's word on a column is why the log is refused.
TEST_F(Correct, SaysWhyAColumnIsNotThere) {
  folder_.write("new.csv", "t,a,b\n0,0.1,nan\n0.1,0.2,nan\n");
  const Outcome outcome = run(command());
  EXPECT_EQ(outcome.code, static_cast<int>(ExitCode::kBadInput));
  EXPECT_NE(outcome.err.find("column 'b'"), std::string::npos) << outcome.err;
  EXPECT_LT(outcome.err.find("warning: "), outcome.err.find("no column 'b'")) << outcome.err;
}

TEST_F(Correct, WritesOverNothing) {
  const auto refused = [&](const std::string& output, const std::string& part, bool force) {
    const std::string before = read_text_file(path(output));
    std::vector<std::string> words{"correct", path("out"), path("new.csv"), "--output",
                                   path(output)};
    if (force) words.emplace_back("--force");
    expect_refusal(words, ExitCode::kBadRequest, part);
    EXPECT_EQ(read_text_file(path(output)), before);
  };
  folder_.write("out/report.html", "page").write("there.csv", "text");
  refused("there.csv", "is there already", false);
  folder_.write("out/run.json", R"({"schema": "kinescope.run", "products": ["report.html"]})");
  for (const bool force : {false, true}) {
    refused("new.csv", "is an input", force);
    refused("out/calibration.json", "is an input", force);
    refused("out/robot.urdf", "is an input", force);
    refused("out/report.html", "is a product of kinescope run", force);
  }
}

TEST_F(Correct, NeedsTheFilesOfTheRun) {
  folder_.remove("out/robot.urdf");
  refused(ExitCode::kBadInput, "robot.urdf");
  folder_.remove("out/calibration.json");
  refused(ExitCode::kBadInput, "calibration.json");
  folder_.write("out/calibration.json", R"({"schema": "kinescope.structure"})");
  refused(ExitCode::kBadInput, "no calibration");
}

TEST_F(Correct, NeedsALogWithTheChannels) {
  folder_.write("new.csv", "t,a,c\n0,0.1,2\n0.1,0.2,4\n");
  refused(ExitCode::kBadInput, "joint2: no column 'b'");
  calibration_["effects"] = json::array();
  write_calibration();
  folder_.write("new.csv", "t,c,tau0\n0,0.1,2\n0.1,0.2,4\n");
  refused(ExitCode::kBadInput, "none of the run's channels (its columns should be a, b)");
  folder_.remove("new.csv");
  refused(ExitCode::kBadInput, "new.csv");
}

TEST_F(Correct, NeedsEffectsOfThisRobot) {
  calibration_["effects"][0]["place"] = "joint9";
  write_calibration();
  refused(ExitCode::kBadInput, "joint9");
}

}  // namespace
}  // namespace kinescope
