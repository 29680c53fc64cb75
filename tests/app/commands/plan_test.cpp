// SPDX-License-Identifier: Apache-2.0
//
// `kinescope plan` on the run of a recording of a simulated robot, which is made once.
#include <filesystem>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/csv.h"
#include "kinematics/log/joint_log.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/commanded_world.h"
#include "tests/truth/recorded_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using PlanJson = nlohmann::json;

constexpr double kRecorded_s = 5.0;

class PlanCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    truth::FilmedRobotOptions robot;
    robot.seed = 9501;
    robot.duration_s = kRecorded_s;
    robot.amplitude_rad = 0.5;
    robot.tag_size_m = 0.06;
    const truth::FilmedRobot drawn = draw_filmed_robot(robot);
    truth::CommandedOptions filmed;
    filmed.end_s = kRecorded_s;
    truth::write_world(commanded_world(drawn, truth::rig_log(drawn, 200.0), filmed),
                       root() / "recording");
    const Outcome made =
        run({"run", (root() / "recording").string(), "-o", run_folder(), "--quiet"});
    ASSERT_EQ(made.code, 0) << made.err;
  }
  static fs::path root() { return truth::temporary_path("planned"); }
  static std::string run_folder() { return (root() / "run").string(); }
  [[nodiscard]] std::string output() const { return (folder_.path() / "next").string(); }
  [[nodiscard]] Outcome planned(std::vector<std::string> words) const {
    std::vector<std::string> all{"plan", run_folder(), "-o", output(), "--quiet", "--seconds", "6"};
    all.insert(all.end(), words.begin(), words.end());
    return run(all);
  }
  [[nodiscard]] std::string written(const std::string& name) const {
    return read_text_file(fs::path(output()) / name);
  }
  RecordingFolder folder_;
};

TEST_F(PlanCommand, WritesAMotionWithinTheLimitsAndWhatItPromises) {
  const Outcome outcome = planned({});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(outcome.out.starts_with("A motion of 6.0 s through ")) << outcome.out;
  EXPECT_NE(outcome.err.find("limits are not declared"), std::string::npos) << outcome.err;
  const PlanJson plan = PlanJson::parse(written("plan.json"));
  EXPECT_LT(plan.at("after_sigma_m"), plan.at("before_sigma_m"));
  const JointLog motion = read_joint_log(fs::path(output()) / "plan.csv");
  ASSERT_EQ(motion.channels.size(), 3U);
  EXPECT_DOUBLE_EQ(motion.times_s.back(), 6.0);
  for (const PlanJson& joint : plan.at("joints")) {
    const auto column = motion.values.col(*motion.channel(joint.at("channel").get<std::string>()));
    EXPECT_GE(column.minCoeff(), joint.at("allowed")[0].get<double>());
    EXPECT_LE(column.maxCoeff(), joint.at("allowed")[1].get<double>());
    EXPECT_LT(joint.at("after").at("position_sigma_m"), joint.at("before").at("position_sigma_m"));
  }
  const ProductCheck check = check_products(output());
  if (check.done) {
    EXPECT_TRUE(check.passed) << check.words;
  }
}

TEST_F(PlanCommand, SameSeedSameBytes) {
  ASSERT_EQ(planned({}).code, 0);
  const std::string first = written("plan.csv");
  ASSERT_EQ(planned({}).code, 0);
  EXPECT_EQ(written("plan.csv"), first);
  ASSERT_EQ(planned({"--seed", "2"}).code, 0);
  EXPECT_NE(written("plan.csv"), first);
}

TEST_F(PlanCommand, PlansPosturesForTheAxes) {
  const Outcome outcome = run({"plan", run_folder(), "-o", output(), "--postures", "7", "--goal",
                               "axes", "--range", "1.5", "--json", "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const PlanJson plan = PlanJson::parse(outcome.out);
  EXPECT_EQ(plan.at("postures"), 7);
  EXPECT_EQ(plan.at("goal"), "axes");
  EXPECT_EQ(plan.at("seconds"), nullptr);
  for (const PlanJson& joint : plan.at("joints")) {
    const double allowed =
        joint.at("allowed")[1].get<double>() - joint.at("allowed")[0].get<double>();
    const double recorded =
        joint.at("recorded")[1].get<double>() - joint.at("recorded")[0].get<double>();
    EXPECT_NEAR(allowed, 1.5 * recorded, 1e-9);
  }
  EXPECT_EQ(read_csv(fs::path(output()) / "plan.csv").rows.size(), 7U);
}

TEST_F(PlanCommand, KeepsToTheLimitsOfAUrdf) {
  std::string urdf = "<robot name=\"r\"><link name=\"base\"/>";
  for (int j = 1; j <= 3; ++j) {
    const std::string n = std::to_string(j);
    const std::string parent = j == 1 ? std::string("base") : "l" + std::to_string(j - 1);
    urdf += "<link name=\"l" + n + "\"/><joint name=\"q" + n +
            "\" type=\"revolute\"><parent link=\"" + parent + "\"/><child link=\"l" + n +
            "\"/><axis xyz=\"0 0 1\"/><limit lower=\"-0.6\" upper=\"0.3\" effort=\"1\" "
            "velocity=\"0.2\"/></joint>";
  }
  folder_.write("limits.urdf", urdf + "</robot>");
  const std::string limits = (folder_.path() / "limits.urdf").string();
  const Outcome outcome =
      run({"plan", run_folder(), "-o", output(), "--quiet", "--limits", limits, "--seconds", "20"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("was recorded beyond the limits"), std::string::npos) << outcome.err;
  const JointLog motion = read_joint_log(fs::path(output()) / "plan.csv");
  EXPECT_GE(motion.values.minCoeff(), -0.6);
  EXPECT_LE(motion.values.maxCoeff(), 0.3);
  const Eigen::MatrixXd steps = motion.values.bottomRows(motion.values.rows() - 1) -
                                motion.values.topRows(motion.values.rows() - 1);
  EXPECT_LE(steps.cwiseAbs().maxCoeff(), 0.2 * 0.01 * (1.0 + 1e-6));
  folder_.write("other.urdf", "<robot name=\"r\"><link name=\"base\"/></robot>");
  expect_refusal(
      {"plan", run_folder(), "-o", output(), "--limits", (folder_.path() / "other.urdf").string()},
      ExitCode::kBadInput, "no joint of it is named");
}

TEST_F(PlanCommand, RefusesWhatItCannotPlan) {
  expect_refusal({"plan", (folder_.path() / "none").string()}, ExitCode::kBadInput,
                 "no such folder");
  expect_refusal({"plan", root().string()}, ExitCode::kBadInput, "no calibration.json");
  expect_refusal({"plan", run_folder(), "--seconds", "5", "--postures", "3"}, ExitCode::kBadRequest,
                 "postures or of a motion");
  expect_refusal({"plan", run_folder(), "--seconds", "nan"}, ExitCode::kBadRequest, "--seconds");
  expect_refusal(
      {"plan", run_folder(), "-o", output(), "--seconds", "1", "--speed", "0.01", "--quiet"},
      ExitCode::kUndetermined, "too short");
  expect_refusal({"plan", run_folder(), "-o", run_folder()}, ExitCode::kBadRequest, "");
  // A run whose recording is gone knows no speeds; postures need none.
  const fs::path moved = folder_.path() / "moved";
  fs::copy(run_folder(), moved, fs::copy_options::recursive);
  fs::remove(moved / "run.json");
  expect_refusal({"plan", moved.string(), "-o", output()}, ExitCode::kBadRequest,
                 "how fast the joints may move is not known");
  EXPECT_EQ(run({"plan", moved.string(), "-o", output(), "--postures", "4", "--quiet"}).code, 0);
  PlanJson damaged = PlanJson::parse(read_text_file(moved / "calibration.json"));
  damaged["covariance"][0][0] = 0.0;
  folder_.write("moved/calibration.json", damaged.dump());
  expect_refusal({"plan", moved.string(), "-o", output(), "--postures", "4"}, ExitCode::kBadInput,
                 "its covariance contradicts");
  damaged["covariance"] = damaged["parameters"] = PlanJson::array();
  folder_.write("moved/calibration.json", damaged.dump());
  expect_refusal({"plan", moved.string(), "-o", output(), "--postures", "4"},
                 ExitCode::kUndetermined, "knows nothing of the robot's joints");
  fs::copy_file(fs::path(run_folder()) / "calibration.json", moved / "calibration.json",
                fs::copy_options::overwrite_existing);
  folder_.write("moved/residuals.csv", "t,tag\n");
  EXPECT_EQ(run({"plan", moved.string(), "-o", output(), "--postures", "4", "--quiet"}).code, 3);
}

}  // namespace
}  // namespace kinescope
