// SPDX-License-Identifier: Apache-2.0
//
// `kinescope compare` on recordings of one robot made anew: camera, markers, motion and clock
// differ between them, the robot does or does not.
#include <filesystem>
#include <numbers>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/report/compare_summary.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/filmed_robot.h"
#include "tests/truth/recorded_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using ComparedJson = nlohmann::json;

constexpr double kRatio = 0.003;
constexpr double kZero_rad = 0.2 * std::numbers::pi / 180.0;

KinematicTree compared_arm(std::size_t joints) {
  truth::FilmedRobotOptions options;
  options.seed = 3;
  KinematicTree out = truth::draw_filmed_robot(options).tree;
  out.joints.resize(joints);
  out.links.resize(joints + 1);
  for (Joint& joint : out.joints) joint.channel = joint.name;
  return out;
}

KinematicTree with_moved_zero(double angle_rad) {
  KinematicTree out = compared_arm(3);
  Joint& joint = out.joints[1];
  joint.T_parent_joint = joint.T_parent_joint * joint_motion(joint.type, joint.axis, angle_rad);
  return out;
}

// A view in which no marker is hidden for long.
truth::World view_of(const KinematicTree& robot, std::uint64_t seed) {
  for (;; seed += 100) {
    truth::WorldOptions options;
    options.seed = seed;
    options.robot = robot;
    options.frames = 300;
    options.sigma_px = 0.03;
    options.time_offset_s = 1e-3 * static_cast<double>(seed % 30);
    truth::World world = truth::make_world(options);
    const auto seen = world.measurements.corners.size();
    if (seen > 9 * 300 * robot.links.size() / 10) return world;
  }
}

// The runs are made once: kept, and copied where a test damages them.
class Compare : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    record("a", compared_arm(3), 1);
    record("b", compared_arm(3), 2);
    record("moved", with_moved_zero(kZero_rad), 4);
    record("far", with_moved_zero(15.0 * kZero_rad), 6);
    record("two", compared_arm(2), 5);
    record("geared", compared_arm(3), 8, 1.0 + kRatio);
    record("degrees", compared_arm(3), 9, 1.0, kRadPerDegree);
    record("ticks", compared_arm(3), 10, 1.0, 2.0 * std::numbers::pi / 65536.0, 32768.0);
  }
  static fs::path runs() { return truth::temporary_path("compared"); }
  static std::string of(const std::string& name) { return (runs() / (name + "_run")).string(); }
  static void record(const std::string& name, const KinematicTree& robot, std::uint64_t seed,
                     double ratio_of_q2 = 1.0, double unit = 1.0, double zero = 0.0) {
    truth::World world = view_of(robot, seed);
    world.log.values.col(1) /= ratio_of_q2;
    world.log.values = (world.log.values / unit).array() + zero;
    truth::write_world(world, runs() / name);
    const Outcome made = run({"run", (runs() / name).string(), "-o", of(name), "--quiet"});
    ASSERT_EQ(made.code, 0) << name << ": " << made.err;
  }
  static ComparedJson compared(const std::vector<std::string>& names) {
    std::vector<std::string> words{"compare", "--json", "--quiet"};
    for (const std::string& name : names) words.push_back(of(name));
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return ComparedJson::parse(outcome.out, nullptr, false);
  }
  // A run of the test's own, to be damaged.
  [[nodiscard]] std::string copied(const std::string& name) const {
    const fs::path to = folder_.path() / name;
    fs::copy(of(name), to, fs::copy_options::recursive);
    return to.string();
  }
  void refused_with(const std::string& calibration, const std::string& part) const {
    folder_.write("damaged/calibration.json", calibration);
    expect_refusal({"compare", of("a"), (folder_.path() / "damaged").string()}, ExitCode::kBadInput,
                   part);
  }
  static ComparedJson calibration() {
    return ComparedJson::parse(read_text_file(fs::path(of("a")) / "calibration.json"));
  }

  RecordingFolder folder_;
};

TEST_F(Compare, TheSameRobotFilmedAnewIsTheSameAndItsModelCarriesOver) {
  const ComparedJson found = compared({"a", "b"});
  EXPECT_EQ(found.at("changed"), false) << found.at("verdict");
  EXPECT_EQ(found.at("differences")[0].at("quantities").size(), 6U + 3U);
  ASSERT_EQ(found.at("carried_over").size(), 2U);
  for (const ComparedJson& one : found.at("carried_over")) {
    EXPECT_EQ(one.at("skipped"), nullptr);
    EXPECT_EQ(one.at("carries"), true) << one;
    EXPECT_NEAR(one.at("carried_rms").get<double>() / one.at("own_rms").get<double>(), 1.0, 0.1);
  }
  const Outcome again = run({"compare", of("a"), of("b"), "--fail-on", "any", "--quiet"});
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_TRUE(again.out.starts_with("Same robot within noise")) << again.out;
}

TEST_F(Compare, ALogInDegreesIsOfTheSameRobotAndItsModelCarriesOver) {
  const ComparedJson found = compared({"a", "degrees"});
  EXPECT_EQ(found.at("changed"), false) << found.at("verdict");
  EXPECT_NE(found.at("findings").dump().find("other units"), std::string::npos);
  for (const ComparedJson& one : found.at("carried_over"))
    EXPECT_EQ(one.at("carries"), true) << one;
  const Outcome again = run({"compare", of("degrees"), of("a"), "--fail-on", "any", "--quiet"});
  EXPECT_EQ(again.code, 0) << again.out << again.err;
}

TEST_F(Compare, ALogInTicksIsComparedInWhatItTells) {
  const ComparedJson found = compared({"a", "ticks"});
  EXPECT_EQ(found.at("changed"), false) << found.at("verdict");
  EXPECT_NE(found.at("findings").dump().find("zeros of their own"), std::string::npos);
  for (const ComparedJson& one : found.at("carried_over"))
    EXPECT_NE(one.at("skipped").dump().find("in another unit"), std::string::npos) << one;
  const Outcome again = run({"compare", of("a"), of("ticks"), "--fail-on", "change", "--quiet"});
  EXPECT_EQ(again.code, 0) << again.out << again.err;
}

TEST_F(Compare, AZeroThatMovedIsNamedWithItsSize) {
  const ComparedJson found = compared({"a", "moved"});
  EXPECT_EQ(found.at("changed"), true);
  const ComparedJson& worst = found.at("differences")[0].at("quantities")[0];
  EXPECT_EQ(worst.at("name"), "zero of q2 (towards q3)");
  EXPECT_NEAR(worst.at("difference").get<double>(), kZero_rad,
              2.0 * worst.at("expanded").get<double>());
  for (const ComparedJson& other : found.at("differences")[0].at("quantities"))
    EXPECT_EQ(other.at("changed"), other == worst) << other;
  // Markers placed anew take up most of so little: significantly worse, and no worse in use.
  for (const ComparedJson& one : found.at("carried_over")) {
    EXPECT_LT(one.at("p_value").get<double>(), 0.05) << one;
    EXPECT_EQ(one.at("carries"), true) << one;
  }
}

// Found as an effect in the one, looked for in vain in the other.
TEST_F(Compare, ARatioThatTracingFoundIsNamedWithItsSize) {
  const ComparedJson found = compared({"a", "geared"});
  EXPECT_EQ(found.at("changed"), true);
  const ComparedJson& worst = found.at("differences")[0].at("quantities")[0];
  EXPECT_EQ(worst.at("name"), "ratio of q2");
  EXPECT_NEAR(worst.at("difference").get<double>(), kRatio,
              2.0 * worst.at("expanded").get<double>());
  for (const ComparedJson& other : found.at("differences")[0].at("quantities"))
    EXPECT_EQ(other.at("changed"), other == worst) << other;
}

TEST_F(Compare, AModelWhoseZeroIsFarOffDoesNotCarryOver) {
  const ComparedJson found = compared({"a", "far"});
  ASSERT_EQ(found.at("carried_over").size(), 2U);
  for (const ComparedJson& one : found.at("carried_over"))
    EXPECT_EQ(one.at("carries"), false) << one;
}

TEST_F(Compare, FailOnTurnsTheExitCodeAndSaysWhy) {
  constexpr int kOutside = static_cast<int>(ExitCode::kOutsideLimits);
  for (const char* limit : {"change", "carry", "any"}) {
    const Outcome outcome = run({"compare", of("a"), of("far"), "--fail-on", limit, "--quiet"});
    EXPECT_EQ(outcome.code, kOutside) << limit;
    EXPECT_TRUE(outcome.err.starts_with("kinescope: outside the limit ")) << outcome.err;
  }
  EXPECT_EQ(run({"compare", of("a"), of("moved"), "--quiet"}).code, 0);
  expect_refusal({"compare", of("a"), of("b"), "--fail-on", "chang"}, ExitCode::kBadRequest,
                 "change");
}

TEST_F(Compare, SeveralRunsAreComparedWithTheFirst) {
  const ComparedJson found = compared({"a", "b", "moved"});
  ASSERT_EQ(found.at("differences").size(), 2U);
  const auto changed = [&](std::size_t run) {
    int count = 0;
    for (const ComparedJson& one : found.at("differences")[run].at("quantities"))
      count += one.at("changed") == true ? 1 : 0;
    return count;
  };
  EXPECT_EQ(changed(0), 0);
  EXPECT_EQ(changed(1), 1);
  EXPECT_NE(found.at("verdict").get<std::string>().find("moved_run"), std::string::npos);
}

TEST_F(Compare, WritesNumbersThatKeepTheirSchemaAndAPage) {
  const std::string output = (folder_.path() / "out").string();
  const Outcome first = run({"compare", of("a"), of("moved"), "-o", output, "--quiet"});
  EXPECT_EQ(first.code, 0) << first.err;
  const std::string page = read_text_file(fs::path(output) / "compare.html");
  EXPECT_NE(page.find("zero of q2"), std::string::npos);
  EXPECT_EQ(page.find("://"), std::string::npos) << "nothing is loaded from anywhere";
  const ProductCheck check = check_products(output);
  if (!check.done) GTEST_SKIP() << check.words;
  EXPECT_TRUE(check.passed) << check.words;
  EXPECT_EQ(run({"compare", of("a"), of("moved"), "-o", output, "--quiet"}).out, first.out);
  EXPECT_EQ(read_text_file(fs::path(output) / "compare.html"), page) << "same bytes";
  folder_.write("theirs/compare.html", "mine");
  expect_refusal({"compare", of("a"), of("b"), "-o", (folder_.path() / "theirs").string()},
                 ExitCode::kBadRequest, "compare.html");
  expect_refusal({"compare", of("a"), of("b"), "-o", of("a")}, ExitCode::kBadRequest, "a_run");
}

TEST_F(Compare, ARecordingThatIsGoneIsSaidAndTheRestCompared) {
  const std::string moved_away = copied("b");
  ComparedJson document = ComparedJson::parse(read_text_file(fs::path(moved_away) / "run.json"));
  document["arguments"][1] = "/nowhere/at/all";
  folder_.write("b/run.json", document.dump());
  const Outcome outcome = run({"compare", of("a"), moved_away, "--json", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const ComparedJson found = ComparedJson::parse(outcome.out);
  EXPECT_NE(found.at("carried_over")[0].at("skipped"), nullptr);
  EXPECT_EQ(found.at("carried_over")[1].at("skipped"), nullptr);
  EXPECT_EQ(run({"compare", of("a"), moved_away, "--fail-on", "carry", "--quiet"}).code, 5);
  EXPECT_EQ(run({"compare", of("a"), moved_away, "--fail-on", "change", "--quiet"}).code, 0);
}

TEST_F(Compare, AStructureThatDiffersIsSaidFirst) {
  const ComparedJson found = compared({"a", "two"});
  EXPECT_EQ(found.at("changed"), true);
  const std::string verdict = found.at("verdict");
  EXPECT_TRUE(verdict.starts_with("Changed: structure: q3 is not in the other")) << verdict;
  EXPECT_TRUE(found.at("differences")[0].at("quantities").empty());
}

TEST_F(Compare, RefusesOneRunTheSameTwiceAndWhatIsNoRun) {
  expect_refusal({"compare", of("a")}, ExitCode::kBadRequest, "one run");
  expect_refusal({"compare", of("a"), of("a") + "/."}, ExitCode::kBadRequest, "given twice");
  expect_refusal({"compare"}, ExitCode::kBadRequest, "RUN_FOLDER");
  expect_refusal({"compare", of("a"), of("nowhere")}, ExitCode::kBadInput, "no such folder");
  expect_refusal({"compare", of("a"), runs().string()}, ExitCode::kBadInput,
                 "holds no calibration.json");
}

TEST_F(Compare, RefusesACalibrationThatIsDamagedOrOfAnotherVersion) {
  const std::string whole = calibration().dump();
  refused_with(whole.substr(0, whole.size() / 2), "ends early");
  refused_with("", "ends early");
  refused_with("[]", "no calibration");
  ComparedJson other = calibration();
  other["schema_version"] = 2;
  refused_with(other.dump(), "not 2");
  other = calibration();
  other["covariance"].erase(0);
  refused_with(other.dump(), "the covariance has not");
  other = calibration();
  other["covariance"][0][0] = nullptr;
  refused_with(other.dump(), "the covariance is no number");
  other = calibration();
  other["robot"]["joints"][1].erase("parameters_at");
  refused_with(other.dump(), "earlier version");
  other = calibration();
  other["robot"]["joints"][1]["parent"] = "nobody";
  refused_with(other.dump(), "no link is named");
  for (const char* key : {"robot", "parameters", "covariance", "camera", "status"}) {
    other = calibration();
    other.erase(key);
    refused_with(other.dump(), key);
    other[key] = 3;
    refused_with(other.dump(), "calibration.json");
  }
}

TEST_F(Compare, RefusesAnotherRobotAndACalibrationWithoutAnAnswer) {
  ComparedJson other = calibration();
  for (ComparedJson& joint : other["robot"]["joints"])
    joint["channel"] = "other_" + joint["channel"].get<std::string>();
  other["robot"]["joints"][0]["type"] = "prismatic";
  refused_with(other.dump(), "another robot");
  other = calibration();
  other["status"] = "not_converged";
  folder_.write("damaged/calibration.json", other.dump());
  expect_refusal({"compare", of("a"), (folder_.path() / "damaged").string()},
                 ExitCode::kUndetermined, "not_converged");
}

TEST_F(Compare, JointsOfOtherNamesAreMatchedByOrder) {
  ComparedJson other = ComparedJson::parse(read_text_file(fs::path(of("b")) / "calibration.json"));
  std::string text = other.dump();
  for (const char* name : {"q1", "q2", "q3"})
    for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos; at += 4)
      text.insert(at, "my");
  folder_.write("renamed/calibration.json", text);
  const Outcome outcome =
      run({"compare", of("a"), (folder_.path() / "renamed").string(), "--json", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const ComparedJson found = ComparedJson::parse(outcome.out);
  EXPECT_EQ(found.at("differences")[0].at("matched_by"), "order");
  EXPECT_EQ(found.at("changed"), false) << found.at("verdict");
}

}  // namespace
}  // namespace kinescope
