// SPDX-License-Identifier: Apache-2.0
//
// A model learned by `kinescope dynamics`, saved, and used by `kinescope predict` on other logs.
#include <algorithm>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/io/torque_model_file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

class PredictCommand : public testing::Test {
 protected:
  PredictCommand() {
    Rng rng = Rng::from_name("predict command");
    const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
    model_ = random_masses(robot.tree, {.every_direction = false}, rng);
    const TorqueWorldOptions usual{.samples = 1500, .trajectories = 1};
    TorqueWorldOptions fast = usual;
    fast.highest_hz = 2.0 * usual.highest_hz;
    TorqueWorldOptions brief = usual;
    brief.samples = 500;
    folder_.write("robot.urdf", write_urdf(model_))
        .write("log.csv", torque_log_csv(torque_log_of(model_, usual, rng)))
        .write("next.csv", torque_log_csv(torque_log_of(model_, usual, rng)))
        .write("fast.csv", torque_log_csv(torque_log_of(model_, fast, rng)))
        .write("brief.csv", torque_log_csv(torque_log_of(model_, brief, rng)));
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  Outcome learn(const std::vector<std::string>& more, const char* log = "log.csv") const {
    std::vector<std::string> words{
        "dynamics", path(log),   "--robot",      path("robot.urdf"),
        "--output", path("out"), "--save-model", path("out/torque_model.json"),
        "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  }
  [[nodiscard]] std::vector<std::string> words(const std::string& log) const {
    return {"predict",  path(log),
            "--model",  path("out/torque_model.json"),
            "--output", path("predicted.csv"),
            "--quiet",  "--force"};
  }

  RecordingFolder folder_;
  DynamicModel model_;
};

TEST_F(PredictCommand, PredictsTheNextLogWithoutTheRobot) {
  const Outcome learned =
      learn({"--no-trace", "--model", "semi_parametric", "--inducing", "40"}, "brief.csv");
  ASSERT_EQ(learned.code, 0) << learned.err;
  EXPECT_NE(learned.out.find("for kinescope predict"), std::string::npos) << learned.out;
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
  EXPECT_TRUE(!check.done || check.words.find("torque_model.json: valid") != std::string::npos);

  std::vector<std::string> json = words("next.csv");
  json.emplace_back("--json");
  const Outcome predicted = run(json);
  ASSERT_EQ(predicted.code, 0) << predicted.err;
  const auto document = nlohmann::json::parse(predicted.out);
  EXPECT_EQ(document.at("model"), "semi_parametric");
  for (const auto& joint : document.at("joints")) {
    EXPECT_LT(joint.at("nmse_percent").get<double>(), 1.0);
    EXPECT_GT(joint.at("within_90").get<double>(), 0.7);
  }
  const std::string table = read_text_file(folder_.path() / "predicted.csv");
  EXPECT_TRUE(table.starts_with("t,trajectory,torque_")) << table.substr(0, 80);
  EXPECT_EQ(std::ranges::count(table, '\n'), 1 + document.at("samples").get<int>());
}

TEST_F(PredictCommand, SaysWhereTheMotionIsNew) {
  // Judged on another log, it learns from all of this one.
  ASSERT_EQ(learn({"--no-trace", "--model", "parametric", "--test", path("next.csv")}).code, 0);
  const Outcome same = run(words("log.csv"));
  ASSERT_EQ(same.code, 0) << same.err;
  EXPECT_EQ(same.out.find("times as fast here"), std::string::npos) << same.out;
  const Outcome fast = run(words("fast.csv"));
  ASSERT_EQ(fast.code, 0) << fast.err;
  EXPECT_NE(fast.out.find("times as fast here as in what was learned"), std::string::npos)
      << fast.out;

  // Another robot's log is refused by the names of its joints.
  std::string other = read_text_file(path("next.csv"));
  const std::size_t line = other.find('\n');
  std::string header;
  for (const char c : other.substr(0, line))
    header += c == '1' ? "_arm" : c == '2' ? "_hand" : std::string(1, c);
  folder_.write("other.csv", header + other.substr(line));
  const Outcome renamed = run(words("other.csv"));
  EXPECT_EQ(renamed.code, 3);
  EXPECT_NE(renamed.err.find("the log's joints (arm, hand) are not the tree's (joint1, joint2)"),
            std::string::npos)
      << renamed.err;
}

TEST_F(PredictCommand, ParametricModelsAreSavedWithWhatTracingFound) {
  DynamicModel smooth = model_;
  for (JointDynamics& joint : smooth.joints) joint = {};
  folder_.write("robot.urdf", write_urdf(smooth));
  ASSERT_EQ(learn({"--model", "parametric"}).code, 0);
  const TorqueModelFile file = read_torque_model(path("out/torque_model.json"));
  ASSERT_TRUE(file.traced) << "the robot has friction that its URDF does not say";
  EXPECT_FALSE(file.traced->corrected.effects.empty());
  const Outcome predicted = run(words("next.csv"));
  ASSERT_EQ(predicted.code, 0) << predicted.err;
  EXPECT_NE(predicted.out.find("with what tracing found"), std::string::npos) << predicted.out;
  // The base of the trace has no masses to trust: what it predicts is right all the same.
  std::vector<std::string> json = words("next.csv");
  json.emplace_back("--json");
  for (const auto& joint : nlohmann::json::parse(run(json).out).at("joints")) {
    EXPECT_LT(joint.at("nmse_percent").get<double>(), 1.0);
  }
}

TEST_F(PredictCommand, WhatCannotBeSavedIsRefusedBeforeAnyWork) {
  const std::vector<std::string> svr{
      "dynamics", path("log.csv"), "--robot",      path("robot.urdf"), "--model", "svr",
      "--output", path("none"),    "--save-model", path("m.json"),     "--quiet"};
  expect_refusal(svr, ExitCode::kBadRequest, "svr cannot be saved");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "none"));
}

TEST_F(PredictCommand, DamagedModelsGetOneLine) {
  ASSERT_EQ(learn({"--no-trace", "--model", "parametric"}).code, 0);
  const std::string whole = read_text_file(folder_.path() / "out/torque_model.json");
  for (const std::size_t size : {std::size_t{0}, whole.size() / 3, whole.size() - 2}) {
    folder_.write("out/torque_model.json", whole.substr(0, size));
    expect_refusal(words("next.csv"), ExitCode::kBadInput, "torque_model.json");
  }
  auto document = nlohmann::json::parse(whole);
  document["schema_version"] = 2;
  folder_.write("out/torque_model.json", document.dump());
  expect_refusal(words("next.csv"), ExitCode::kBadInput, "reads version 1 of torque models, not 2");
  folder_.write("out/torque_model.json", read_text_file(folder_.path() / "out/dynamics.json"));
  expect_refusal(words("next.csv"), ExitCode::kBadInput, "this is no torque model");
  expect_refusal({"predict", path("next.csv"), "--model", path("no.json")}, ExitCode::kBadInput,
                 "no.json");
}

TEST_F(PredictCommand, CurrentsAreNotHeldAgainstTorques) {
  ASSERT_EQ(learn({"--no-trace", "--model", "parametric"}).code, 0);
  std::vector<std::string> currents = words("next.csv");
  currents.insert(currents.end(), {"--torque-unit", "A"});
  expect_refusal(currents, ExitCode::kBadInput, "its torques are in A, the model's in Nm");
}

}  // namespace
}  // namespace kinescope
