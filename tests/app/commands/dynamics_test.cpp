// SPDX-License-Identifier: Apache-2.0
//
// `kinescope dynamics` as a user meets it: results, products, refusals.
#include <algorithm>
#include <limits>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/report/torque_summary.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

class DynamicsCommand : public testing::Test {
 protected:
  DynamicsCommand() {
    Rng rng = Rng::from_name("dynamics command");
    const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
    model_ = random_masses(robot.tree, {.every_direction = false}, rng);
    samples_ = torque_log_of(model_, {.samples = 1500, .trajectories = 1}, rng);
    folder_.write("log.csv", torque_log_csv(samples_)).write("robot.urdf", write_urdf(model_));
  }
  [[nodiscard]] std::string path(const char* name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> out{"dynamics",         path("log.csv"), "--robot",
                                 path("robot.urdf"), "--model",       "parametric",
                                 "--output",         path("out"),     "--quiet"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }

  RecordingFolder folder_;
  DynamicModel model_;
  TorqueSamples samples_;
};

TEST_F(DynamicsCommand, GivesModelUrdfAndReport) {
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("parametric"), std::string::npos);
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  EXPECT_EQ(document.at("schema"), "kinescope.dynamics");
  ASSERT_EQ(document.at("models").size(), 1U);
  for (const auto& nmse : document.at("models")[0].at("nmse_percent")) {
    EXPECT_LT(nmse.get<double>(), 1.0);
  }
  const DynamicModel written = read_dynamic_urdf(folder_.path() / "out/robot_dynamics.urdf");
  EXPECT_EQ(written.tree.joints.size(), model_.tree.joints.size());
  const std::string page = read_text_file(folder_.path() / "out/dynamics.html");
  EXPECT_EQ(page.find("nan"), std::string::npos);
  EXPECT_NE(page.find("Models side by side"), std::string::npos);
}

TEST_F(DynamicsCommand, ReadingsAtALimitAreLeftOutAndSaid) {
  Eigen::VectorXd torque = samples_.torque.col(0);
  std::ranges::sort(torque);
  const double limit = torque[torque.size() * 4 / 5];
  samples_.torque.col(0) = samples_.torque.col(0).cwiseMin(limit);
  folder_.write("log.csv", torque_log_csv(samples_));
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::size_t said = outcome.err.find("column 'tau1' is cut off at");
  ASSERT_NE(said, std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("these readings are left out", said), std::string::npos);
  EXPECT_EQ(outcome.err.find("tau1", said + 20), std::string::npos) << "said once";
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  for (const auto& model : document.at("models")) {
    for (const auto& nmse : model.at("nmse_percent"))
      EXPECT_LT(nmse.get<double>(), 1.0) << model.at("model");
  }
  for (const auto& effect : document.at("trace").at("accepted"))
    EXPECT_NE(effect.at("effect"), "contact") << effect;
  EXPECT_FALSE(document.at("trace").at("verdict") == "unknown")
      << document.at("trace").at("reason");
}

// Friction that the URDF does not declare is sized once: by tracing, where it is traced.
TEST_F(DynamicsCommand, ADriveHasOneAnswer) {
  DynamicModel bare = model_;
  for (JointDynamics& joint : bare.joints) joint.viscous = joint.coulomb = 0.0;
  folder_.write("robot.urdf", write_urdf(bare));
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  int traced = 0;
  for (const auto& effect : document.at("trace").at("accepted")) {
    for (const auto& drive : document.at("drives")) {
      if (drive.at("term") != effect.at("effect") || drive.at("joint") != effect.at("place"))
        continue;
      EXPECT_EQ(drive.at("value"), effect.at("size")) << drive;
      ++traced;
    }
  }
  EXPECT_GE(traced, 2) << document.at("trace").dump(1);
}

// By default: parametric, and two processes through inducing points; each says what it learned
// from.
TEST_F(DynamicsCommand, UsualModelsAreLearnedQuicklyAndSayFromWhat) {
  const std::vector<std::string> usual{"dynamics",         path("log.csv"), "--robot",
                                       path("robot.urdf"), "--samples",     "400",
                                       "--output",         path("out"),     "--no-trace"};
  const Outcome outcome = run(usual);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("samples inducing"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("chosen of 3 by motion left out of the training"), std::string::npos)
      << outcome.out;
  EXPECT_NE(outcome.err.find("gip model: 12 of 12"), std::string::npos) << outcome.err;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  const auto& models = document.at("models");
  ASSERT_EQ(models.size(), 3U);
  EXPECT_EQ(models[0].at("model"), "parametric");
  EXPECT_EQ(models[0].at("inducing_points"), 0);
  for (const std::size_t k : {1U, 2U}) {
    EXPECT_EQ(models[k].at("samples"), 400);
    EXPECT_GT(models[k].at("inducing_points"), 0);
    EXPECT_LE(models[k].at("inducing_points"), 200);
    EXPECT_EQ(models[k].at("left_out_nmse_percent").size(), 2U);
    for (const auto& nmse : models[k].at("nmse_percent")) EXPECT_LT(nmse.get<double>(), 5.0);
  }
  EXPECT_NE(read_text_file(folder_.path() / "out/dynamics.html").find("Inducing points"),
            std::string::npos);
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
}

// The model that tracing corrected stands beside the others, on the same test samples.
TEST_F(DynamicsCommand, TheTracedModelIsJudgedLikeTheOthers) {
  DynamicModel bare = model_;
  for (JointDynamics& joint : bare.joints) joint.viscous = joint.coulomb = 0.0;
  folder_.write("robot.urdf", write_urdf(bare));
  const Outcome outcome = run(words());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("\ntraced "), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("no test sample had a part in it"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("was chosen on the whole log"), std::string::npos) << outcome.out;
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  const auto& traced = document.at("models").back();
  ASSERT_EQ(traced.at("model"), "traced");
  EXPECT_EQ(traced.at("samples"), document.at("data").at("training"));
  for (const char* key : {"nmse_percent", "left_out_nmse_percent"}) {
    ASSERT_EQ(traced.at(key).size(), 2U);
    for (const auto& nmse : traced.at(key)) EXPECT_LT(nmse.get<double>(), 1.0) << key;
  }
  for (const auto& share : traced.at("coverage_90")) EXPECT_NEAR(share.get<double>(), 0.9, 0.1);
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
}

TEST_F(DynamicsCommand, ASplitByLotSaysThatItFlatters) {
  const Outcome outcome = run(words({"--split", "random", "--no-trace"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("nMSE on samples of the log by lot"), std::string::npos)
      << outcome.out;
  EXPECT_NE(outcome.out.find("these figures flatter"), std::string::npos) << outcome.out;
  EXPECT_NE(read_text_file(folder_.path() / "out/dynamics.html").find("by lot, which flatters"),
            std::string::npos);
  EXPECT_EQ(run(words({"--split", "random", "--test", path("log.csv")})).code, 2);
}

// Learned from half the speed: said in words, where another log is judged on.
TEST_F(DynamicsCommand, SaysWhereTheTestIsNew) {
  TorqueSamples slow = samples_;
  slow.t_s *= 2.0;
  slow.dq /= 2.0;
  slow.ddq /= 4.0;
  folder_.write("slow.csv", torque_log_csv(slow));
  std::vector<std::string> command = words({"--no-trace", "--test", path("log.csv")});
  command[1] = path("slow.csv");
  const Outcome outcome = run(command);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("times as fast here as in what was learned"), std::string::npos)
      << outcome.out;
}

TEST_F(DynamicsCommand, TheSameLogGivesTheSameBytes) {
  ASSERT_EQ(run(words()).code, 0);
  const std::string first = read_text_file(folder_.path() / "out/dynamics.json");
  ASSERT_EQ(run(words()).code, 0);
  EXPECT_EQ(read_text_file(folder_.path() / "out/dynamics.json"), first);
}

// Without tracing no trace of an earlier `dynamics` stays; that of a calibration, of the same name,
// does.
TEST_F(DynamicsCommand, StaleTracesGo) {
  const std::vector<std::string> traces{"trace.json", "robot_traced.urdf",
                                        "torque_compensated.csv"};
  std::string list;
  for (const std::string& name : traces) {
    folder_.write("out/" + name, "");
    list += "dynamics " + name + "\n";
  }
  folder_.write("out/.kinescope_products", list);
  const std::vector<std::string> quick = words({"--no-trace"});
  ASSERT_EQ(run(quick).code, 0);
  for (const std::string& name : traces) {
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out" / name)) << name;
  }
  folder_.write("out/trace.json", R"({"schema": "kinescope.trace"})");
  ASSERT_EQ(run(quick).code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "out/trace.json"));
}

TEST_F(DynamicsCommand, RefusesWhatCannotBe) {
  expect_refusal(words({"--model", "perceptron"}), ExitCode::kBadRequest,
                 "'perceptron' is no torque model");
  expect_refusal(words({"--gravity", "0,0"}), ExitCode::kBadRequest, "gravity");
  folder_.write("log.csv", "t,q1,q2,dq1,dq2\n0,0,0,0,0\n1,0,0,0,0\n");
  expect_refusal(words(), ExitCode::kBadInput, "log.csv");
  folder_.write("log.csv", torque_log_csv(samples_));
  folder_.write("robot.urdf", "<robot name='r'><link name='a'/></robot>");
  const Outcome none = run(words());
  EXPECT_NE(none.code, 0);
  EXPECT_NE(none.code, 1) << none.err;
}

TEST_F(DynamicsCommand, TorquesInTheWrongUnitAreNamed) {
  TorqueSamples wrong = samples_;
  wrong.torque *= 1000.0;
  folder_.write("log.csv", torque_log_csv(wrong));
  const std::string line = expect_refusal(words(), ExitCode::kBadInput, "torque of joint");
  EXPECT_NE(line.find("mNm"), std::string::npos) << line;
  EXPECT_EQ(run(words({"--torque-unit", "mNm"})).code, 0);
  folder_.write("recording.yaml", "dynamics: {torque_unit: [mNm]}\n");
  EXPECT_EQ(run(words()).code, 0) << "the settings beside the log count too";
}

TEST_F(DynamicsCommand, RobustRegressionsAndPartsAreInTheResult) {
  ASSERT_EQ(run(words({"--no-trace"})).code, 0);
  const auto without = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  EXPECT_TRUE(without.at("robust").is_null()) << "only when asked for";
  ASSERT_EQ(run(words({"--no-trace", "--robust"})).code, 0);
  const auto document = nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
  const auto& robust = document.at("robust");
  ASSERT_EQ(robust.at("methods").size(), 3U);
  EXPECT_EQ(robust.at("methods")[2].at("method"), "student");
  for (const auto& nmse : robust.at("methods")[2].at("nmse_percent")) {
    EXPECT_LT(nmse.get<double>(), 1.0);
  }
  ASSERT_EQ(robust.at("joints").size(), 2U);
  EXPECT_GT(robust.at("joints")[0].at("gravity_rms").get<double>() +
                robust.at("joints")[1].at("gravity_rms").get<double>(),
            0.0);
  EXPECT_FALSE(robust.at("joints")[0].at("profile").empty());
  EXPECT_TRUE(document.at("payload").is_null());
  EXPECT_NE(read_text_file(folder_.path() / "out/dynamics.html").find("Robust regression"),
            std::string::npos);
}

TEST_F(DynamicsCommand, SaysWhatTheRobotCarries) {
  constexpr double kMass = 0.8;
  Rng rng = Rng::from_name("payload command");
  // Four joints: two turn a load through too few postures to weigh it.
  const DynamicModel empty =
      random_masses(random_robot({.joints = 4, .prismatic_share = 0.0}, rng).tree,
                    {.every_direction = false}, rng);
  DynamicModel full = empty;
  const std::string hand = make_rigid_model(empty).bodies.back().name;
  for (std::size_t l = 0; l < full.links.size(); ++l) {
    if (full.tree.links[l].name != hand) continue;
    full.links[l] += from_central({.mass_kg = kMass,
                                   .centre_m = {0.0, 0.02, 0.1},
                                   .inertia_kgm2 = 1e-3 * Eigen::Matrix3d::Identity()});
  }
  const TorqueWorldOptions world{.samples = 2500, .trajectories = 1};
  folder_.write("robot.urdf", write_urdf(empty))
      .write("log.csv", torque_log_csv(torque_log_of(full, world, rng)))
      .write("empty.csv", torque_log_csv(torque_log_of(empty, world, rng)));
  for (const bool two_logs : {false, true}) {
    const Outcome outcome = run(two_logs ? words({"--no-trace", "--unloaded", path("empty.csv")})
                                         : words({"--no-trace", "--payload"}));
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find(hand + " carries"), std::string::npos) << outcome.out;
    const auto document =
        nlohmann::json::parse(read_text_file(folder_.path() / "out/dynamics.json"));
    for (const char* how : {"motion", "at_rest"}) {
      const auto& found = document.at("payload").at(how);
      // Twice the 95 % interval: once in ten thousand logs.
      const double half = found.at("upper_kg").get<double>() - found.at("mass_kg").get<double>();
      EXPECT_NEAR(found.at("mass_kg").get<double>(), kMass, 2.0 * half) << how;
      EXPECT_LT(half, 0.5 * kMass) << how;
    }
    EXPECT_NE(read_text_file(folder_.path() / "out/dynamics.html").find("payload-table"),
              std::string::npos);
  }
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
}

TEST_F(DynamicsCommand, GravityThatNobodyDeclaredIsSaid) {
  const Outcome silent = run(words({"--no-trace", "--no-robust"}));
  EXPECT_NE(silent.out.find("Nothing was declared about gravity"), std::string::npos) << silent.out;
  const Outcome declared = run(words({"--no-trace", "--no-robust", "--gravity=0,0,-9.81"}));
  EXPECT_EQ(declared.out.find("Nothing was declared"), std::string::npos) << declared.out;
}

TEST(TorqueVerdictWords, AConstantChannelJudgesNoModel) {
  TorqueSummary summary;
  summary.joints = {"turn", "slide"};
  summary.types = {JointType::kRevolute, JointType::kPrismatic};
  summary.split = "a test";
  summary.identification.sigma = Eigen::Vector2d(0.1, 0.1);
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (const double error : {2.0, 1.0}) {
    TorqueScore score;
    score.nmse_percent = Eigen::Vector2d(none, error);
    score.rms = Eigen::Vector2d(0.1, 0.1);
    score.coverage_95 = Eigen::Vector2d(0.95, 0.95);
    summary.scores.push_back(score);
  }
  summary.best = 1;
  EXPECT_EQ(mean_nmse_percent(summary.scores[1]), 1.0);
  const std::string words = torque_verdict(summary).accurate;
  EXPECT_NE(words.find("the first of 2"), std::string::npos) << words;
  EXPECT_NE(words.find("the 1 of 2 joints"), std::string::npos) << words;
  EXPECT_NE(words.find("worst slide with 1 %"), std::string::npos) << words;
  for (TorqueScore& score : summary.scores) score.nmse_percent.setConstant(none);
  EXPECT_NE(torque_verdict(summary).accurate.find("judges no model"), std::string::npos);
}

// A robot of one joint whose torques ask for this mass, 0.5 m away.
std::string limits_of(double mass_kg, double nmse_percent) {
  TorqueSummary summary;
  summary.joints = {"turn"};
  summary.types = {JointType::kRevolute};
  summary.identification.sigma = Eigen::VectorXd::Constant(1, 0.1);
  DynamicModel& model = summary.consistent.model;
  model.tree.joints.resize(1);
  model.tree.joints[0].T_parent_joint.translation = {0.5, 0.0, 0.0};
  model.links.resize(2);
  model.links[1].mass_kg = mass_kg;
  TorqueScore score;
  score.nmse_percent = Eigen::VectorXd::Constant(1, nmse_percent);
  score.rms = Eigen::VectorXd::Constant(1, 0.1);
  score.coverage_95 = Eigen::VectorXd::Constant(1, 0.95);
  summary.scores = {score};
  return torque_verdict(summary).limits;
}

TEST(TorqueVerdictWords, MassesThatNoRobotHasAskForTheUnit) {
  EXPECT_EQ(limits_of(3.0, 0.1).find("masses"), std::string::npos) << limits_of(3.0, 0.1);
  EXPECT_NE(limits_of(3000.0, 0.1).find("3e+03 kg on a reach of 0.5 m"), std::string::npos)
      << limits_of(3000.0, 0.1);
  EXPECT_NE(limits_of(0.003, 0.1).find("check the unit of the torques"), std::string::npos);
}

TEST(TorqueVerdictWords, WhoIsWorseThanAConstantIsNamed) {
  TorqueSummary summary;
  summary.joints = {"turn", "slide"};
  summary.types = {JointType::kRevolute, JointType::kPrismatic};
  for (const double error : {18183.0, 2.0}) {
    TorqueScore score;
    score.kind = error > 100.0 ? TorqueModelKind::kRbf : TorqueModelKind::kGip;
    score.nmse_percent = Eigen::Vector2d(error, 1.0);
    summary.scores.push_back(score);
  }
  summary.scores[1].constant_joints = {1};
  const std::vector<std::string> notes = model_notes(summary);
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_NE(notes[0].find("rbf is worse than a constant at turn"), std::string::npos) << notes[0];
  EXPECT_NE(notes[1].find("gip is a constant at slide"), std::string::npos) << notes[1];
  summary.identification.white_covariance.resize(0, 0);
  summary.best = 0;
  EXPECT_TRUE(torque_json(summary).at("best").is_null());
  summary.best = 1;
  EXPECT_EQ(torque_json(summary).at("best"), "gip");
}

TEST(TorqueVerdictWords, WorseThanAConstantIsNothingLearned) {
  EXPECT_NE(limits_of(3.0, 250.0).find("worse than a constant"), std::string::npos);
  EXPECT_EQ(limits_of(3.0, 50.0).find("worse than a constant"), std::string::npos);
}

// A stand-in for a robot: a kilogram on one axis that gravity does not turn.
constexpr const char* kOneJoint = R"(<robot name="one"><link name="base"/>
<link name="tip"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="JOINT" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-6" upper="6" effort="100" velocity="10"/></joint></robot>)";

std::string one_joint(const std::string& name) {
  std::string out = kOneJoint;
  out.replace(out.find("JOINT"), 5, name);
  return out;
}

// Joints that creep at some mrad/s against friction: the traced model needs a Coulomb friction that
// the score test does not see, and its torque is a million times what the masses say.
TEST(OneJointCommand, MeasuredFrictionOfOneJointIsTraced) {
  const auto logs = shared_data("dynamics/franka_fairino_friction");
  if (!logs) GTEST_SKIP() << "shared/data/dynamics/franka_fairino_friction is not on this machine";
  const RecordingFolder folder;
  const std::vector<std::pair<std::string, std::string>> cases{
      {"joint3", "fairino_line_slow_joint3"}, {"joint2", "fairino_spiral_slow_joint2"}};
  for (const auto& [joint, log] : cases) {
    folder.write("robot.urdf", one_joint(joint));
    const Outcome outcome =
        run({"dynamics", (*logs / (log + ".csv.gz")).string(), "--robot",
             (folder.path() / "robot.urdf").string(), "--torque", "tau_friction" + joint.substr(5),
             "--model", "parametric", "--no-robust", "--output", (folder.path() / "out").string(),
             "--quiet"});
    EXPECT_EQ(outcome.code, 0) << log << ": " << outcome.err;
    EXPECT_NE(outcome.out.find("Tracing: "), std::string::npos) << outcome.out;
    // Friction that turns round within 0.01 rad/s at every joint left 12.3 and 19.6 %.
    const auto document =
        nlohmann::json::parse(read_text_file(folder.path() / "out/dynamics.json"));
    EXPECT_LT(document.at("models")[0].at("nmse_percent")[0].get<double>(), 11.0) << log;
    EXPECT_GT(document.at("data").at("cutoff_hz").get<double>(), 0.7) << log;
  }
}

}  // namespace
}  // namespace kinescope
