// SPDX-License-Identifier: Apache-2.0
//
// Torque logs and robots that cannot be used, through the program: one line that names the file and
// the remedy, the documented exit code, and what lay in the output folder is still there.
#include <limits>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/gzip.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

constexpr double kDegrees = 57.29577951308232;
const std::string kEarlier = "{\"from\": \"an earlier run\"}\n";

class TorqueRefusals : public testing::Test {
 protected:
  TorqueRefusals() {
    Rng rng = Rng::from_name("torque refusals");
    const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
    model_ = random_masses(robot.tree, {.every_direction = false}, rng);
    samples_ = torque_log_of(model_, {.samples = 1200, .trajectories = 1}, rng);
    folder_.write("robot.urdf", write_urdf(model_));
    folder_.write("out/dynamics.json", kEarlier)
        .write("out/.kinescope_products", "dynamics dynamics.json\n");
  }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more = {},
                                               const std::string& log = "log.csv") const {
    std::vector<std::string> out{"dynamics", path(log),    "--robot",    path("robot.urdf"),
                                 "--model",  "parametric", "--no-trace", "--no-robust",
                                 "--output", path("out"),  "--quiet"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
  void write(const TorqueSamples& samples) { folder_.write("log.csv", torque_log_csv(samples)); }

  /// The refusal, and the earlier result untouched.
  std::string refused(ExitCode code, const std::string& part,
                      const std::vector<std::string>& more = {},
                      const std::string& log = "log.csv") {
    const std::string line = expect_refusal(words(more, log), code, part);
    EXPECT_EQ(read_text_file(folder_.path() / "out/dynamics.json"), kEarlier) << line;
    return line;
  }

  RecordingFolder folder_;
  DynamicModel model_;
  TorqueSamples samples_;
};

TEST_F(TorqueRefusals, TorqueColumnsMissing) {
  TorqueSamples without = samples_;
  without.torque.resize(0, 0);
  write(without);
  const std::string line = refused(ExitCode::kBadInput, "log.csv");
  EXPECT_NE(line.find("torque"), std::string::npos) << line;
}

TEST_F(TorqueRefusals, DegreesForRadiansAreFoundFromTheVelocity) {
  TorqueSamples wrong = samples_;
  wrong.q *= kDegrees;
  wrong.ddq.resize(0, 0);
  write(wrong);
  const std::string line = refused(ExitCode::kBadInput, "log.csv");
  EXPECT_NE(line.find("deg"), std::string::npos) << line;
  EXPECT_EQ(run(words({"--position-unit", "deg"})).code, 0) << "the remedy works";
}

TEST_F(TorqueRefusals, DegreesEverywhereAreFoundFromTheirSize) {
  TorqueSamples wrong = samples_;
  for (Eigen::MatrixXd* values : {&wrong.q, &wrong.dq, &wrong.ddq}) *values *= kDegrees;
  write(wrong);
  const std::string line = refused(ExitCode::kBadInput, "log.csv");
  EXPECT_NE(line.find("deg"), std::string::npos) << line;
}

TEST_F(TorqueRefusals, AThousandfoldTorqueIsNamed) {
  TorqueSamples wrong = samples_;
  wrong.torque /= 1000.0;
  write(wrong);
  const std::string line = refused(ExitCode::kBadInput, "torque of joint");
  EXPECT_NE(line.find("kNm"), std::string::npos) << line;
}

TEST_F(TorqueRefusals, AConstantTorqueIsNamed) {
  TorqueSamples wrong = samples_;
  wrong.torque.col(1).setConstant(0.5);
  write(wrong);
  const Outcome outcome = run(words());
  if (outcome.code == 0) {
    const std::string document = read_text_file(folder_.path() / "out/dynamics.json");
    EXPECT_NE(document.find("\"constant\""), std::string::npos);
    EXPECT_NE(document.find("tau2"), std::string::npos);
  } else {
    EXPECT_NE(outcome.err.find("tau2"), std::string::npos) << outcome.err;
  }
}

TEST_F(TorqueRefusals, ARobotAtRestDeterminesNothing) {
  TorqueSamples rest = samples_;
  rest.q.setZero();
  rest.dq.setZero();
  rest.ddq.setZero();
  rest.torque.rowwise() = samples_.torque.row(0);
  write(rest);
  const Outcome outcome = run(words());
  EXPECT_TRUE(outcome.code == 3 || outcome.code == 4) << outcome.code << outcome.err;
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
  EXPECT_EQ(read_text_file(folder_.path() / "out/dynamics.json"), kEarlier);
}

TEST_F(TorqueRefusals, AFewNaNRowsAreLeftOutAndSaidSo) {
  TorqueSamples broken = samples_;
  broken.torque.row(300).setConstant(std::numeric_limits<double>::quiet_NaN());
  broken.q.row(700).setConstant(std::numeric_limits<double>::quiet_NaN());
  write(broken);
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  EXPECT_NE(document.at("data").at("findings").dump().find("not_a_number"), std::string::npos);
}

TEST_F(TorqueRefusals, MostlyNaNIsRefused) {
  TorqueSamples broken = samples_;
  broken.torque.topRows(900).setConstant(std::numeric_limits<double>::quiet_NaN());
  write(broken);
  refused(ExitCode::kBadInput, "log.csv");
}

TEST_F(TorqueRefusals, JointsOfTheRobotThatAreNotTheLogs) {
  Rng rng = Rng::from_name("another robot");
  const RandomRobot robot = random_robot({.joints = 3, .prismatic_share = 0.0}, rng);
  folder_.write("robot.urdf",
                write_urdf(random_masses(robot.tree, {.every_direction = false}, rng)));
  write(samples_);
  const std::string line = refused(ExitCode::kBadInput, "joints");
  EXPECT_NE(line.find("recording.yaml"), std::string::npos) << line;
}

TEST_F(TorqueRefusals, FilesThatAreNoLogs) {
  const std::string good = torque_log_csv(samples_);
  const auto no_log = [&](const std::string& content, const char* why) {
    SCOPED_TRACE(why);
    folder_.write("log.csv", content);
    refused(ExitCode::kBadInput, "log.csv");
  };
  no_log("", "empty");
  no_log("t,q1,q2,tau1,tau2\n", "no rows");
  no_log(std::string(4096, '\0'), "zeros");
  no_log(std::string("\xff\xfe\0garbage\n\x01\x02,\x03\n", 16), "binary");
  no_log("t,q1,q2,tau1,tau2\n0,0,0,0\n", "a short row");
  no_log("t,q1,q1,q2,tau1,tau2\n0,0,0,0,0,0\n1,0,0,0,0,0\n", "a column twice");
  no_log(std::string(1 << 20, 'x'), "one long word");
  no_log("t,q1,q2,tau1,tau2\n0,0,0,0,0\n1,zero,0,0,0\n", "words for numbers");
}

TEST_F(TorqueRefusals, HugeNumbersAreNoMotion) {
  TorqueSamples huge = samples_;
  huge.q.row(100).setConstant(1e300);
  huge.torque.row(101).setConstant(-1e300);
  write(huge);
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string document = read_text_file(folder_.path() / "out/dynamics.json");
  EXPECT_NE(document.find("infinite"), std::string::npos);
}

TEST_F(TorqueRefusals, ACutOffPackedLog) {
  const std::string whole = gzip(torque_log_csv(samples_));
  folder_.write("log.csv.gz", whole.substr(0, whole.size() / 2));
  refused(ExitCode::kBadInput, "log.csv.gz", {}, "log.csv.gz");
  folder_.write("log.csv.gz", "no gzip at all");
  refused(ExitCode::kBadInput, "log.csv.gz", {}, "log.csv.gz");
}

TEST_F(TorqueRefusals, WhatIsNotThere) {
  refused(ExitCode::kBadInput, "no_such.csv", {}, "no_such.csv");
  write(samples_);
  refused(ExitCode::kBadInput, "no_test.csv", {"--test", path("no_test.csv")});
  refused(ExitCode::kBadInput, "no_empty.csv", {"--unloaded", path("no_empty.csv")});
  folder_.write("robot.urdf", "<robot name='r'><link");
  refused(ExitCode::kBadInput, "robot.urdf");
}

TEST_F(TorqueRefusals, MomentsWithoutMass) {
  write(samples_);
  std::string urdf = write_urdf(model_);
  const std::size_t mass = urdf.find("<mass value=\"") + 13;
  urdf.replace(mass, urdf.find('"', mass) - mass, "0");
  folder_.write("robot.urdf", urdf);
  const std::string line = refused(ExitCode::kBadInput, "has moments of inertia and no mass");
  EXPECT_NE(line.find("robot.urdf: link '"), std::string::npos) << line;
}

// The log's rows and the robot's problem are two things.
TEST_F(TorqueRefusals, InspectSaysWhatTheLogHoldsBesideABrokenRobot) {
  write(samples_);
  folder_.write("robot.urdf", "<robot name='r'><link");
  const Outcome outcome = run({"inspect", path("log.csv"), "--robot", path("robot.urdf")});
  EXPECT_EQ(outcome.code, static_cast<int>(ExitCode::kBadInput)) << outcome.err;
  EXPECT_NE(outcome.out.find("log.csv: 1200 rows"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("robot.urdf:1: is not well-formed XML"), std::string::npos)
      << outcome.out;
}

TEST_F(TorqueRefusals, PayloadsThatCannotBeAskedFor) {
  write(samples_);
  refused(ExitCode::kBadRequest, "'wing'", {"--payload", "--payload-link", "wing"});
  refused(ExitCode::kBadRequest, "--torque-factor", {"--payload", "--torque-unit", "A"});
  DynamicModel massless = model_;
  for (InertialParameters& link : massless.links) link = {};
  folder_.write("robot.urdf", write_urdf(massless));
  refused(ExitCode::kBadRequest, "--unloaded", {"--payload"});
}

// Before tracing and the models, which would take minutes and leave files.
TEST_F(TorqueRefusals, APayloadOfCurrentsIsRefusedBeforeAnyWork) {
  write(samples_);
  expect_refusal({"dynamics", path("log.csv"), "--robot", path("robot.urdf"), "--payload",
                  "--torque-unit", "A", "--output", path("out"), "--quiet"},
                 ExitCode::kBadRequest, "--torque-factor");
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path() / "out")) {
    files.insert(entry.path().filename().string());
  }
  EXPECT_EQ(files, (std::set<std::string>{".kinescope_products", "dynamics.json"}));
  EXPECT_EQ(read_text_file(folder_.path() / "out/dynamics.json"), kEarlier);
}

// All of them: it is the log's sign, which the advice turns, and no robot upside down.
TEST_F(TorqueRefusals, TorquesThatAllHaveTheOtherSign) {
  TorqueSamples turned = samples_;
  turned.torque *= -1.0;
  write(turned);
  refused(ExitCode::kBadInput, "torque_factor: [-1, -1]");
  folder_.write("recording.yaml", "dynamics: {torque_factor: [-1, -1]}\n");
  const Outcome outcome = run(words());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
}

// A joint whose torque has the other sign: the advice names that joint alone, and works.
TEST_F(TorqueRefusals, TheAdviceForATurnedTorqueTurnsThatJoint) {
  TorqueSamples turned = samples_;
  turned.torque.col(1) *= -1.0;
  write(turned);
  refused(ExitCode::kBadInput, "torque_factor: [1, -1]");
  folder_.write("recording.yaml", "dynamics: {torque_factor: [1, -1]}\n");
  const Outcome outcome = run(words());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
}

TEST_F(TorqueRefusals, ContactRefusesAlike) {
  TorqueSamples without = samples_;
  without.torque.resize(0, 0);
  write(without);
  const std::vector<std::string> contact{"contact",  path("log.csv"), "--robot", path("robot.urdf"),
                                         "--output", path("out"),     "--quiet"};
  expect_refusal(contact, ExitCode::kBadInput, "torque");
  folder_.write("log.csv", "");
  expect_refusal(contact, ExitCode::kBadInput, "log.csv");
  TorqueSamples degrees = samples_;
  degrees.q *= kDegrees;
  write(degrees);
  expect_refusal(contact, ExitCode::kBadInput, "deg");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out/contacts.csv"));
}

TEST_F(TorqueRefusals, InspectNamesTheSame) {
  write(samples_);
  const Outcome good = run({"inspect", path("log.csv"), "--robot", path("robot.urdf")});
  EXPECT_EQ(good.code, 0) << good.out;
  EXPECT_NE(good.out.find("tau2"), std::string::npos) << good.out;
  EXPECT_NE(good.out.find("ready for kinescope dynamics"), std::string::npos) << good.out;
  TorqueSamples wrong = samples_;
  wrong.torque *= 1000.0;
  write(wrong);
  const Outcome milli = run({"inspect", path("log.csv"), "--robot", path("robot.urdf"), "--json"});
  EXPECT_EQ(milli.code, static_cast<int>(ExitCode::kBadInput));
  const auto document = nlohmann::json::parse(milli.out);
  EXPECT_FALSE(document.at("ready").get<bool>());
  EXPECT_NE(document.at("problems").dump().find("mNm"), std::string::npos) << milli.out;
  EXPECT_EQ(document.at("joints").size(), 2U);
  wrong = samples_;
  wrong.torque.resize(0, 0);
  write(wrong);
  const Outcome bare = run({"inspect", path("log.csv")});
  EXPECT_EQ(bare.code, static_cast<int>(ExitCode::kBadInput));
  EXPECT_NE(bare.out.find("no torque columns"), std::string::npos) << bare.out;
  folder_.write("log.csv", "");
  EXPECT_EQ(run({"inspect", path("log.csv")}).code, static_cast<int>(ExitCode::kBadInput));
}

}  // namespace
}  // namespace kinescope
