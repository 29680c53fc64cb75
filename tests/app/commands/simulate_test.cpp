// SPDX-License-Identifier: Apache-2.0
//
// `kinescope simulate` makes logs from which `kinescope dynamics` finds what was put in, and
// `kinescope export` gives the robot to MuJoCo.
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/kinematics/mat/mat_writer.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

constexpr double kDuration_s = 20.0;
constexpr double kRate_hz = 100.0;

/// Sums of three sines a joint: slow enough for friction, with reversals.
std::string trajectory_csv(const std::vector<std::string>& joints, double duration_s) {
  std::string text = "t";
  for (const std::string& joint : joints) text += "," + joint;
  text += "\n";
  for (int i = 0; i <= static_cast<int>(duration_s * kRate_hz); ++i) {
    const double t = i / kRate_hz;
    text += fmt::format("{}", t);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double w = 0.9 + 0.37 * static_cast<double>(j);
      text += fmt::format(",{}", 0.8 * std::sin(w * t) + 0.3 * std::sin(2.3 * w * t + 1.0) +
                                     0.05 * std::sin(7.1 * w * t + 2.0));
    }
    text += "\n";
  }
  return text;
}

constexpr const char* kEffects =
    "effects:\n"
    "  - {effect: viscous, joint: JOINT1, parameters: {viscous: 0.8}}\n"
    "  - {effect: coulomb, joint: JOINT1, parameters: {coulomb: 1.5}}\n"
    "  - {effect: stribeck, joint: JOINT1, at: 0.15, parameters: {excess_at_rest: 0.9}}\n"
    "  - {effect: viscous, joint: JOINT2, parameters: {viscous: 0.6}}\n"
    "  - {effect: ripple, joint: JOINT2, at: 12, parameters: {sine: 0.5, cosine: 0.3}}\n";

class Simulate : public testing::Test {
 protected:
  Simulate() {
    Rng rng = Rng::from_name("simulate command");
    model_ = random_masses(random_robot({.joints = 3, .prismatic_share = 0.0}, rng).tree,
                           {.every_direction = false, .motors = false}, rng);
    for (const JointId id : moving_joints(model_.tree)) {
      joints_.push_back(model_.tree.joints[id.index()].name);
      model_.joints[id.index()].motor_inertia = 0.05;
    }
    folder_.write("robot.urdf", write_urdf(model_))
        .write("path.csv", trajectory_csv(joints_, kDuration_s))
        .write("brief.csv", trajectory_csv(joints_, 2.0))
        .write("effects.yaml", with_names(kEffects));
  }
  [[nodiscard]] std::string with_names(std::string text) const {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const std::string word = fmt::format("JOINT{}", j + 1);
      for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos;) {
        text.replace(at, word.size(), joints_[j]);
      }
    }
    return text;
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more,
                                               const std::string& trajectory = "brief.csv") const {
    std::vector<std::string> out{"simulate", path("robot.urdf"), "--trajectory", path(trajectory),
                                 "-o",       path("log.csv"),    "--force",      "--quiet"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
  [[nodiscard]] nlohmann::json document(const std::string& name) const {
    return nlohmann::json::parse(read_text_file(folder_.path() / name));
  }
  void expect_found(const nlohmann::json& trace, const std::string& effect,
                    const std::string& place, double size) const {
    for (const auto& found : trace.at("accepted")) {
      if (found.at("effect") != effect || found.at("place") != place) continue;
      EXPECT_LE(found.at("interval")[0].get<double>(), size) << effect << " at " << place;
      EXPECT_GE(found.at("interval")[1].get<double>(), size) << effect << " at " << place;
      return;
    }
    ADD_FAILURE() << effect << " at " << place << " was not found";
  }

  RecordingFolder folder_;
  DynamicModel model_;
  std::vector<std::string> joints_;
};

TEST_F(Simulate, DynamicsTracesBackWhatWasPutIn) {
  const Outcome simulated = run(words(
      {"--effects", path("effects.yaml"), "--torque-noise", "0.05", "--rate", "500"}, "path.csv"));
  ASSERT_EQ(simulated.code, 0) << simulated.err;
  EXPECT_NE(simulated.out.find("5 effects"), std::string::npos) << simulated.out;
  const Outcome traced = run({"dynamics", path("log.csv"), "--robot", path("robot.urdf"), "-o",
                              path("out"), "--model", "parametric", "--quiet"});
  ASSERT_EQ(traced.code, 0) << traced.err;
  const auto trace = document("out/trace.json");
  expect_found(trace, "viscous", joints_[0], 0.8);
  expect_found(trace, "coulomb", joints_[0], 1.5);
  expect_found(trace, "stribeck", joints_[0], 0.9);
  expect_found(trace, "viscous", joints_[1], 0.6);
  expect_found(trace, "ripple", joints_[1], std::hypot(0.5, 0.3));
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;

  // Forward in time, the traced model stays near the log that no effect explains without it.
  const auto rollout = document("out/dynamics.json").at("rollout");
  EXPECT_EQ(rollout.at("failure"), "");
  EXPECT_TRUE(rollout.at("seen_by_trace").get<bool>());
  ASSERT_EQ(rollout.at("horizons").size(), 3U);
  const auto& half_second = rollout.at("horizons")[1];
  EXPECT_LT(half_second.at("with_effects").at("tool_m").get<double>(),
            0.2 * half_second.at("without_effects").at("tool_m").get<double>());
  EXPECT_NE(traced.out.find("Driven by the measured torques alone for 0.5 s"), std::string::npos);
  EXPECT_NE(read_text_file(folder_.path() / "out/dynamics.html").find("id=\"rollout-table\""),
            std::string::npos);

  // What was traced is a plant: from the folder's trace, and for MuJoCo.
  const Outcome again = run(words({"--effects", path("out/trace.json")}));
  EXPECT_EQ(again.code, 0) << again.err;
  const Outcome exported =
      run({"export", path("out"), "--mjcf", path("robot.xml"), "--json", "--quiet"});
  ASSERT_EQ(exported.code, 0) << exported.err;
  const auto told = nlohmann::json::parse(exported.out);
  EXPECT_TRUE(told.at("urdf").get<std::string>().ends_with("robot_traced.urdf"));
  EXPECT_NE(told.at("left_out").dump().find("ripple at " + joints_[1]), std::string::npos);
  const std::string mjcf = read_text_file(folder_.path() / "robot.xml");
  EXPECT_NE(mjcf.find("frictionloss="), std::string::npos);
  EXPECT_NE(mjcf.find("damping="), std::string::npos);
}

TEST_F(Simulate, FrictionOfTheUrdfAndOfTheEffectsIsCountedOnce) {
  DynamicModel rubbing = model_;
  JointDynamics& drive = rubbing.joints[moving_joints(model_.tree)[0].index()];
  drive.viscous = 0.5;
  drive.coulomb = 1.25;
  folder_.write("rubbing.urdf", write_urdf(rubbing));
  ASSERT_EQ(run(words({"--effects", path("effects.yaml")})).code, 0);
  const std::string once = read_text_file(path("log.csv"));
  std::vector<std::string> with_friction = words({"--effects", path("effects.yaml")});
  with_friction[1] = path("rubbing.urdf");
  const Outcome outcome = run(with_friction);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(read_text_file(path("log.csv")), once);
  EXPECT_NE(outcome.err.find("damping of " + joints_[0] + " (0.5), friction of " + joints_[0] +
                             " (1.25) give way"),
            std::string::npos)
      << outcome.err;
}

// The sum of a link and of a payload whose inertia is badly known is none that a body has.
TEST_F(Simulate, ATracedPayloadIsABodyOfItsOwnForMujoco) {
  const LinkId last = model_.tree.joints[moving_joints(model_.tree).back().index()].child;
  const std::string& link = model_.tree.links[last.index()].name;
  DynamicModel loaded = model_;
  Eigen::VectorXd load(10);
  load << 0.5, 0.05, 0.0, 0.1, 9.0, 0.0, 0.0, 0.0, 0.0, 0.0;  // Ixx without Iyy and Izz
  loaded.links[last.index()] += InertialParameters::from_vector(load);
  nlohmann::json parameters = nlohmann::json::array();
  for (std::size_t k = 0; k < kInertialNames.size(); ++k)
    parameters.push_back(
        {{"name", kInertialNames[k]}, {"value", load[static_cast<Eigen::Index>(k)]}});
  const nlohmann::json trace = {{"base", {{"masses", "declared"}}},
                                {"effects",
                                 {{{"effect", "payload"},
                                   {"place", link},
                                   {"at", 0.0},
                                   {"in_urdf", true},
                                   {"parameters", parameters}}}}};
  folder_.write("traced/robot_traced.urdf", write_urdf(loaded))
      .write("traced/trace.json", trace.dump());
  const Outcome exported =
      run({"export", path("traced"), "--mjcf", path("robot.xml"), "--json", "--quiet"});
  ASSERT_EQ(exported.code, 0) << exported.err;
  const std::string mjcf = read_text_file(folder_.path() / "robot.xml");
  const std::size_t body = mjcf.find("<body name=\"payload_" + link + "\"");
  ASSERT_NE(body, std::string::npos) << mjcf;
  EXPECT_NE(mjcf.find("<inertial pos=\"0.1 0 0.2\" mass=\"0.5\"", body), std::string::npos) << mjcf;
}

TEST_F(Simulate, AServoGivesTheLogOfARobotThatSticks) {
  const Outcome simulated = run(words({"--effects", path("effects.yaml"), "--servo", "--json"}));
  ASSERT_EQ(simulated.code, 0) << simulated.err;
  for (const auto& joint : nlohmann::json::parse(simulated.out).at("joints")) {
    EXPECT_GT(joint.at("tracking_error").get<double>(), 0.0);
    EXPECT_LT(joint.at("tracking_error").get<double>(), 0.05);
  }
}

// The commands that take torque logs read them alike.
TEST_F(Simulate, ALogMayBeAMatFile) {
  ASSERT_EQ(run(words({"--torque-noise", "0.1"})).code, 0);
  const CsvTable table = read_csv(path("log.csv"));
  mat::MatWriter writer({.big_endian = false, .packed = true});
  for (std::size_t column = 0; column < table.header.size(); ++column) {
    std::vector<double> values;
    for (std::size_t row = 0; row < table.rows.size(); ++row)
      values.push_back(table.number(row, column));
    writer.doubles(table.header[column], 1, static_cast<std::int32_t>(values.size()), values);
  }
  folder_.write("log.mat", writer.bytes());
  const auto seen = [&](const std::string& log) {
    const Outcome outcome =
        run({"inspect", path(log), "--robot", path("robot.urdf"), "--json", "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    auto out = nlohmann::json::parse(outcome.out, nullptr, false);
    out.erase("torque_log");
    return out;
  };
  EXPECT_EQ(seen("log.mat"), seen("log.csv"));
  const auto contacts = [&](const std::string& log) {
    const Outcome outcome = run(
        {"contact", path(log), "--robot", path("robot.urdf"), "-o", path(log + "_out"), "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return read_text_file(folder_.path() / (log + "_out") / "contacts.csv");
  };
  EXPECT_EQ(contacts("log.mat"), contacts("log.csv"));
  folder_.write("new.mat", "MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00");
  expect_refusal({"dynamics", path("new.mat"), "--robot", path("robot.urdf"), "-o", path("out")},
                 ExitCode::kBadInput, "save -v7");
}

TEST_F(Simulate, TheSameSeedGivesTheSameBytes) {
  ASSERT_EQ(run(words({"--servo", "--torque-noise", "0.1", "--seed", "5"})).code, 0);
  const std::string first = read_text_file(path("log.csv"));
  ASSERT_EQ(run(words({"--servo", "--torque-noise", "0.1", "--seed", "5"})).code, 0);
  EXPECT_EQ(read_text_file(path("log.csv")), first);
  ASSERT_EQ(run(words({"--servo", "--torque-noise", "0.1", "--seed", "6"})).code, 0);
  EXPECT_NE(read_text_file(path("log.csv")), first);
}

TEST_F(Simulate, WhatPointsToAnotherRobotsTrajectoryIsSaidByNames) {
  EXPECT_EQ(run(words({})).err, "");
  folder_.write("other.csv", trajectory_csv({"base", "arm", "hand"}, 2.0));
  const Outcome named_otherwise = run(words({}, "other.csv"));
  EXPECT_EQ(named_otherwise.code, 0);
  EXPECT_NE(named_otherwise.err.find("taken in their order: " + joints_[0] + " = base, " +
                                     joints_[1] + " = arm"),
            std::string::npos)
      << named_otherwise.err;
  std::vector<std::string> more = joints_;
  more.emplace_back("gripper");
  more.push_back("dq_" + joints_[0]);
  folder_.write("more.csv", trajectory_csv(more, 2.0));
  const Outcome longer = run(words({}, "more.csv"));
  EXPECT_EQ(longer.code, 0);
  EXPECT_NE(longer.err.find("3 joints are wanted, the log has 4: 'gripper' left out"),
            std::string::npos)
      << longer.err;
}

TEST_F(Simulate, ATrajectoryInDegreesIsRefused) {
  std::string degrees = "t";
  for (const std::string& joint : joints_) degrees += "," + joint;
  degrees += "\n";
  for (int i = 0; i < 200; ++i) {
    const double t = i / kRate_hz;
    degrees += fmt::format("{0},{1},{1},{1}\n", t, 90.0 * std::sin(3.0 * t));
  }
  folder_.write("degrees.csv", degrees);
  expect_refusal(words({}, "degrees.csv"), ExitCode::kBadInput, "is it in degrees?");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "log.csv"));
}

TEST_F(Simulate, RefusesWhatItCannotSimulate) {
  folder_
      .write("stribek.yaml",
             with_names("effects:\n  - {effect: stribek, joint: JOINT1, parameters: {}}\n"))
      .write("elbow.yaml",
             "effects:\n  - {effect: viscous, joint: elbow, parameters: {viscous: 1}}\n")
      .write("parameter.yaml",
             with_names("effects:\n  - {effect: viscous, joint: JOINT1, parameters: {b: 1}}\n"))
      .write("at.yaml", with_names("effects:\n  - {effect: stribeck, joint: JOINT1, parameters: "
                                   "{excess_at_rest: 1}}\n"))
      .write("other.csv", "t,a,b\n0,1,2\n1,2,3\n")
      .write("calibration.json", "{\"schema\": 1}")
      .write("weightless.urdf", write_urdf(without_masses(model_.tree)));
  const auto refused = [&](const char* file, const std::string& part) {
    expect_refusal(words({"--effects", path(file)}), ExitCode::kBadInput, part);
  };
  refused("stribek.yaml", "did you mean 'stribeck'");
  refused("elbow.yaml", "elbow.yaml:2");
  refused("parameter.yaml", "viscous has no parameter 'b'");
  refused("at.yaml", "add at: the Stribeck speed");
  refused("calibration.json", "is no trace of torques");
  refused("nothing.yaml", "nothing.yaml");
  expect_refusal(words({}, "other.csv"), ExitCode::kBadInput, "other.csv");
  expect_refusal({"simulate", path("weightless.urdf"), "--trajectory", path("brief.csv"), "-o",
                  path("x.csv"), "--quiet"},
                 ExitCode::kBadInput, "no link has a mass");
  expect_refusal(words({"--servo", "--kp", "1,2"}), ExitCode::kBadRequest,
                 "2 values of kp for 3 joints");
  expect_refusal(words({"--servo", "--delay", "0.2", "--bandwidth", "40"}), ExitCode::kUndetermined,
                 "grows without bound");
  expect_refusal(words({"--kp", "1,2,3"}), ExitCode::kBadRequest, "--servo");
  expect_refusal({"export", path("weightless.urdf"), "--mjcf", path("x.xml"), "--quiet"},
                 ExitCode::kBadRequest, "has no mass");
  EXPECT_FALSE(std::filesystem::exists(path("x.csv")));
  EXPECT_FALSE(std::filesystem::exists(path("x.xml")));
}

}  // namespace
}  // namespace kinescope
