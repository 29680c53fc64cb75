// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/report/fleet_summary.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/recordings_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class Fleet : public testing::Test {
 protected:
  /// Three robots: `sharp` and, with more noise, `noisy`, of a recording each, and one whose
  /// recording is not there.
  void SetUp() override {
    truth::FilmedRobotOptions robot;
    robot.seed = 7001;
    robot.kind = truth::RobotKind::kScara;
    robot.duration_s = 8.0;
    robot.tag_size_m = 0.06;
    robot.scale = 1.5;
    robot.distance_m = 1.6;
    std::vector<truth::RecordingOptions> recordings(2);
    recordings[0].name = "first";
    recordings[1].name = "second";
    recordings[1].camera.sigma_px = 0.3;
    truth::write_recordings(truth::make_recordings(robot, recordings), recordings, folder_.path());
    folder_.write("robots.csv", "robot,recording\nsharp,first\nnoisy,second\nabsent,third\n");
  }

  [[nodiscard]] std::string in(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] Outcome fleet(std::vector<std::string> more = {}) const {
    more.insert(more.begin(),
                {"fleet", in("robots.csv"), "-o", in("fleet"), "--no-trace", "--quiet"});
    return run(std::move(more));
  }
  [[nodiscard]] json table() const { return json::parse(read_text_file(in("fleet/fleet.json"))); }
  [[nodiscard]] std::vector<std::string> robots() const {
    std::vector<std::string> out;
    const json document = table();
    for (const json& robot : document.at("robots")) out.push_back(robot.at("name"));
    return out;
  }

  RecordingFolder folder_;
};

TEST_F(Fleet, IsATableOfRobotsWorstFirst) {
  const Outcome done = fleet();
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_EQ(robots(), (std::vector<std::string>{"absent", "noisy", "sharp"}));
  const json rows = table().at("robots");
  EXPECT_EQ(rows[0].at("exit_code"), 3);
  EXPECT_NE(rows[0].at("reason").get<std::string>().find("third"), std::string::npos);
  EXPECT_TRUE(rows[0].at("held_out_rms").is_null());
  const json alone = json::parse(read_text_file(in("fleet/noisy/result.json")));
  EXPECT_EQ(rows[1].at("held_out_rms"), alone.at("errors").at("all").at("held_out_px").at("rms"));
  EXPECT_EQ(rows[1].at("tip_expanded_m"), alone.at("tip").at("translation_expanded_m"));
  EXPECT_EQ(rows[1].at("rms_unit"), "px");
  const CsvTable csv = read_csv(in("fleet/fleet.csv"));
  ASSERT_EQ(csv.rows.size(), 3U);
  EXPECT_EQ(csv.rows[2][csv.require_column("robot")], "sharp");
  const std::string page = read_text_file(in("fleet/fleet.html"));
  EXPECT_NE(page.find("href=\"noisy/report.html\""), std::string::npos);
  EXPECT_EQ(page.find("absent/report.html"), std::string::npos) << "there is none";
  for (const std::string& folder : {in("fleet"), in("fleet/noisy"), in("fleet/absent")}) {
    const ProductCheck check = check_products(folder);
    EXPECT_TRUE(!check.done || check.passed) << check.words;
  }
}

TEST_F(Fleet, ShardsRunTheRobotsAndTheTableTakesThemAsTheyAre) {
  ASSERT_EQ(fleet({"--shard", "1/2", "--threads", "1"}).code, 0);
  EXPECT_TRUE(fs::exists(in("fleet/sharp/robot.urdf")));
  EXPECT_FALSE(fs::exists(in("fleet/noisy"))) << "of the other shard";
  EXPECT_FALSE(fs::exists(in("fleet/fleet.json")));
  const auto written = fs::last_write_time(in("fleet/sharp/run.json"));
  ASSERT_EQ(fleet().code, 0) << "what no shard did is done now";
  EXPECT_EQ(fs::last_write_time(in("fleet/sharp/run.json")), written) << "it was not run again";
  EXPECT_EQ(robots().size(), 3U);
  // Other bytes, other options, a lost answer: run again.
  const std::string joints = in("first/joints.csv");
  write_file_atomically(joints, read_text_file(joints) + "\n");
  ASSERT_EQ(fleet().code, 0);
  const auto changed = fs::last_write_time(in("fleet/sharp/run.json"));
  EXPECT_GT(changed, written);
  ASSERT_EQ(fleet({"--folds", "3"}).code, 0);
  EXPECT_GT(fs::last_write_time(in("fleet/sharp/run.json")), changed);
  fs::remove(in("fleet/sharp/run.json"));
  ASSERT_EQ(fleet({"--folds", "3"}).code, 0);
  EXPECT_TRUE(fs::exists(in("fleet/sharp/run.json")));
}

TEST_F(Fleet, LimitsAreOfEveryRobotAndOfTheFleet) {
  folder_.write("robots.csv", "robot,recording\nsharp,first\nnoisy,second\n");
  EXPECT_EQ(fleet({"--fail-on", "nonsense>9"}).code, 2) << "of no robot, but of the command";
  EXPECT_FALSE(fs::exists(in("fleet")));
  EXPECT_EQ(fleet({"--fail-on", "held_out_px>9"}).code, 0);
  const Outcome outside = fleet({"--fail-on", "held_out_px>0.3"});
  EXPECT_EQ(outside.code, 5) << outside.err;
  const json worst = table().at("robots").at(0);
  EXPECT_EQ(worst.at("name"), "noisy");
  EXPECT_EQ(worst.at("exit_code"), 5);
  EXPECT_NE(worst.at("reason").get<std::string>().find("held_out_px"), std::string::npos);
  EXPECT_EQ(fleet({"--fail-on", "held_out_px>0.3", "--shard", "1/1"}).code, 0)
      << "a shard is done, whatever its robots came to";
}

TEST_F(Fleet, AListThatSaysNothingIsRefusedInOneLine) {
  const auto refused = [&](const char* text, ExitCode code, const char* word) {
    folder_.write("robots.csv", text);
    expect_refusal({"fleet", in("robots.csv"), "-o", in("fleet")}, code, word);
    EXPECT_FALSE(fs::exists(in("fleet")));
  };
  refused("robot,folder\na,first\n", ExitCode::kBadInput, "recording");
  refused("robot,recording\n../a,first\n", ExitCode::kBadInput, "robots.csv:2");
  refused("robot,recording\na,\n", ExitCode::kBadInput, "robots.csv:2");
  refused("robot,recording\n", ExitCode::kBadInput, "robots.csv");
  expect_refusal({"fleet", in("nowhere.csv")}, ExitCode::kBadInput, "nowhere.csv");
  expect_refusal({"fleet", in("robots.csv"), "--shard", "3/2"}, ExitCode::kBadRequest, "no shard");
}

TEST(FleetTable, EffectsAreNamedWithTheirSizesTheLargestFirst) {
  const json result = json::parse(R"({"run": {"kind": "corners"},
    "errors": {"all": {"held_out_px": {"rms": 0.25}}}, "tip": null,
    "trace": {"accepted": [
      {"effect": "encoder_scale", "place": "q1", "size": 0.01, "unit": "", "explained": 0.1},
      {"effect": "backlash", "place": "q2", "size": 0.02, "unit": "rad", "explained": 0.7}]}})");
  FleetRobot robot;
  robot.name = "arm, \"left\"";
  take_result(result, robot);
  ASSERT_EQ(robot.effects.size(), 2U);
  EXPECT_EQ(robot.effects.front().effect, "backlash");
  EXPECT_FALSE(robot.tip_expanded_m.has_value());
  const FleetSummary summary{"1", "", {}, {robot}};
  EXPECT_NE(
      fleet_csv(summary).find("\"arm, \"\"left\"\"\",0,,0.25,px,,,2,backlash at q2,0.02,rad,0"),
      std::string::npos)
      << fleet_csv(summary);
  EXPECT_NE(fleet_html(summary).find("2: backlash at q2 (1.15°), encoder_scale at q1 (0.01"),
            std::string::npos);
  EXPECT_EQ(fleet_robot_json(fleet_robot_of(fleet_robot_json(robot))), fleet_robot_json(robot));
}

}  // namespace
}  // namespace kinescope
