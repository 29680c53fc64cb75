// SPDX-License-Identifier: Apache-2.0
//
// `kinescope control`: what was learned of a simulated robot makes it follow better, with and
// without a load, in rounds; refusals.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

/// Sums of two sines a joint; `phase` makes another path of it.
std::string path_csv(const std::vector<std::string>& joints, double duration_s, double phase,
                     double size = 1.0) {
  std::string text = "t";
  for (const std::string& joint : joints) text += "," + joint;
  text += "\n";
  constexpr double kReferenceRate_hz = 100.0;
  for (int i = 0; i <= static_cast<int>(duration_s * kReferenceRate_hz); ++i) {
    const double t = i / kReferenceRate_hz;
    text += fmt::format("{}", t);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double w = 1.3 + 0.41 * static_cast<double>(j) + 0.2 * phase;
      text += fmt::format(
          ",{}", size * (0.7 * std::sin(w * t + phase) + 0.25 * std::sin(2.3 * w * t + 1.0)));
    }
    text += "\n";
  }
  return text;
}

// Times: of this arm, which learns from 12 s, 9 to 20.
constexpr double kSmaller = 5.0;

class Control : public testing::Test {
 protected:
  Control() {
    Rng rng = Rng::from_name("control command");
    model_ = random_masses(random_robot({.joints = 2, .prismatic_share = 0.0}, rng).tree,
                           {.every_direction = false, .motors = false}, rng);
    for (const JointId id : moving_joints(model_.tree)) {
      Joint& joint = model_.tree.joints[id.index()];
      joint.limits = JointLimits{-1.5, 1.5};
      joints_.push_back(joint.name);
      model_.joints[id.index()].motor_inertia = 0.1;
    }
    std::string effects = "effects:\n";
    for (const std::string& joint : joints_) {
      effects += fmt::format(
          "  - {{effect: coulomb, joint: {0}, parameters: {{coulomb: 1.5}}}}\n"
          "  - {{effect: viscous, joint: {0}, parameters: {{viscous: 0.8}}}}\n",
          joint);
    }
    folder_.write("robot.urdf", write_urdf(model_))
        .write("path.csv", path_csv(joints_, 3.0, 0.0))
        .write("training.csv", path_csv(joints_, 12.0, 1.7))
        .write("effects.yaml", effects);
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more,
                                               const std::string& output = "out") const {
    std::vector<std::string> out{
        "control",   path("robot.urdf"),   "--trajectory", path("path.csv"), "--rate", "250",
        "--effects", path("effects.yaml"), "-o",           path(output),     "--quiet"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
  [[nodiscard]] nlohmann::json document(const std::string& folder) const {
    return nlohmann::json::parse(read_text_file(folder_.path() / folder / "control.json"));
  }
  void expect_refused(const std::vector<std::string>& more, int code,
                      const std::string& reason) const {
    const Outcome outcome = run(words(more, "refused"));
    EXPECT_EQ(outcome.code, code) << outcome.out << outcome.err;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "refused")) << reason;
  }

  RecordingFolder folder_;
  DynamicModel model_;
  std::vector<std::string> joints_;
};

const nlohmann::json& run_named(const nlohmann::json& document, const std::string& log) {
  for (const auto& one : document.at("runs")) {
    if (one.at("log") == log) return one;
  }
  throw std::runtime_error(log + " was not run");
}

void expect_smaller(const nlohmann::json& after, const nlohmann::json& before, double factor) {
  for (std::size_t j = 0; j < before.at("error").size(); ++j) {
    EXPECT_LT(factor * after.at("error")[j].get<double>(), before.at("error")[j].get<double>())
        << after.at("name") << " joint " << j;
  }
}

TEST_F(Control, RoundsLearnAndALoadIsIdentified) {
  const std::vector<std::string> command =
      words({"--rounds", "1", "--training", path("training.csv"), "--payload", "0.6,0.02,0,0.1",
             "--torque-noise", "0.02"});
  const Outcome outcome = run(command);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto result = document("out");
  const auto& before = run_named(result, "before.csv");
  EXPECT_EQ(before.at("round"), 0);
  EXPECT_EQ(before.at("law"), "pd_gravity");
  const auto& after = run_named(result, "round1.csv");
  EXPECT_EQ(after.at("round"), 1);
  expect_smaller(after, before, kSmaller);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_LT(after.at("feedback_share")[j].get<double>(),
              0.5 * before.at("feedback_share")[j].get<double>());
  }
  expect_smaller(run_named(result, "loaded_known.csv"), run_named(result, "loaded_before.csv"),
                 kSmaller);
  expect_smaller(run_named(result, "loaded_known.csv"), run_named(result, "loaded_unknown.csv"),
                 1.5);
  EXPECT_NEAR(result.at("payload").at("mass_kg").get<double>(), 0.6, 0.05);
  const ProductCheck check = check_products(folder_.path() / "out");
  EXPECT_TRUE(check.passed || !check.done) << check.words;
  const std::string page = read_text_file(folder_.path() / "out/control.html");
  EXPECT_NE(page.find("id=\"errors-table\""), std::string::npos);
  EXPECT_NE(page.find("Error by round"), std::string::npos);
  EXPECT_EQ(page.find("<script"), std::string::npos);

  // What a round saved is a model for another call, and its trace the same.
  const Outcome learned = run(words({"--model", path("out/round1/torque.json")}, "learned"));
  ASSERT_EQ(learned.code, 0) << learned.err;
  const auto by_file = document("learned");
  expect_smaller(run_named(by_file, "learned.csv"), run_named(by_file, "before.csv"), kSmaller);
  const Outcome traced = run(words({"--model", path("out/round1/dynamics.json")}, "traced"));
  ASSERT_EQ(traced.code, 0) << traced.err;
  const auto by_trace = document("traced");
  expect_smaller(run_named(by_trace, "learned.csv"), run_named(by_trace, "before.csv"), kSmaller);
  EXPECT_EQ(run_named(by_trace, "before.csv").at("error"),
            run_named(by_file, "before.csv").at("error"));

  // A model of another robot is refused.
  std::string other = read_text_file(folder_.path() / "robot.urdf");
  const std::string name = "name=\"" + model_.tree.name + "\"";
  ASSERT_NE(other.find(name), std::string::npos);
  folder_.write("other.urdf", other.replace(other.find(name), name.size(), "name=\"other\""));
  expect_refused({"--nominal", path("other.urdf"), "--model", path("out/round1/torque.json")},
                 static_cast<int>(ExitCode::kBadInput), "the model is of robot");

  // The same bytes again; what others wrote stays.
  const std::string first = read_text_file(folder_.path() / "out/round1.csv");
  ASSERT_EQ(run(command).code, 0);
  EXPECT_EQ(read_text_file(folder_.path() / "out/round1.csv"), first);
  // A log that dynamics reads.
  EXPECT_EQ(run({"inspect", path("out/before.csv"), "--robot", path("robot.urdf"), "--quiet"}).code,
            0);
}

TEST_F(Control, EveryLawRuns) {
  for (const char* law : {"pd", "pd_gravity", "computed_torque"}) {
    const Outcome outcome = run(words({"--law", law, "--json", "--encoder-step", "1e-5"}, law));
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto result = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(result.at("runs").back().at("law"), law);
    EXPECT_LT(result.at("runs").back().at("error")[0].get<double>(), 0.5) << law;
  }
}

TEST_F(Control, RefusesWhatDoesNotFit) {
  std::string other = read_text_file(folder_.path() / "robot.urdf");
  const std::string name = "\"" + joints_[1] + "\"";
  for (std::size_t at = 0; (at = other.find(name, at)) != std::string::npos;) {
    other.replace(at, name.size(), "\"elsewhere\"");
  }
  folder_.write("other.urdf", other).write("model.json", "{\"schema\": 1}");
  const int input = static_cast<int>(ExitCode::kBadInput);
  const int request = static_cast<int>(ExitCode::kBadRequest);
  expect_refused({"--nominal", path("other.urdf")}, input, "other joints");
  expect_refused({"--model", path("model.json")}, input, "model.json");
  expect_refused({"--model", path("none.json")}, input, "none.json");
  expect_refused({"--torque-limit", "0.01,0.01"}, request, "holding it on the trajectory needs");
  expect_refused({"--torque-limit", "5"}, request, "2 joints");
  expect_refused({"--torque-limit", "nan,1"}, request, "--torque-limit");
  expect_refused({"--torque-rate-limit", "0,0"}, request, "no torque would ever change");
  expect_refused({"--kp", "1,1", "--law", "computed_torque"}, request, "computed torque");
  expect_refused({"--velocity-cutoff", "200"}, request, "below half the rate");
  expect_refused({"--payload", "-1"}, request, "above 0");
  expect_refused({"--training", path("training.csv")}, request, "--rounds");
  expect_refused({"--learn", "gip"}, request, "--rounds");
  expect_refused({"--law", "pd", "--rounds", "1"}, request, "no place for what was learned");
  folder_.write("path.csv", path_csv(joints_, 3.0, 0.0, 3.0));
  expect_refused({}, input, "limits");
}

}  // namespace
}  // namespace kinescope
