// SPDX-License-Identifier: Apache-2.0
//
// One robot out of shards: the same bytes as the run in one piece, and a line for whatever is wrong
// with the parts.
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/io/recording_list.h"
#include "app/io/shard.h"
#include "kinematics/core/file.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/film.h"
#include "tests/truth/recordings_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kRateHz = 5.0;  // of the frames

std::vector<truth::RecordingOptions> two_days() {
  std::vector<truth::RecordingOptions> out(2);
  out[0].name = "monday";
  out[1].name = "tuesday";
  out[1].motion = 2;
  out[1].camera.azimuth_rad = 0.4;
  for (truth::RecordingOptions& one : out) one.camera.rate_hz = kRateHz;
  return out;
}

truth::FilmedRobotOptions small_robot() {
  truth::FilmedRobotOptions out;
  out.seed = 7001;
  out.kind = truth::RobotKind::kScara;
  out.duration_s = 4.0;
  out.tag_size_m = 0.06;
  out.scale = 1.5;
  out.distance_m = 1.6;
  return out;
}

class Shards : public testing::Test {
 protected:
  /// Two recordings and their list, as corners.
  void record() {
    const std::vector<truth::RecordingOptions> days = two_days();
    truth::write_recordings(truth::make_recordings(small_robot(), days), days, folder_.path());
    write_list();
  }

  /// The same, filmed (once: that takes seconds).
  void film() {
    static const fs::path films = filmed();
    fs::copy(films, folder_.path(), fs::copy_options::recursive);
    write_list();
  }

  [[nodiscard]] std::string in(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::vector<std::string> of_list(std::vector<std::string> more) const {
    more.insert(more.begin(), {"run", "@" + in("list.txt"), "--no-trace", "--quiet"});
    return more;
  }
  void make_part(int index, int count, const std::string& into) const {
    const Outcome made =
        run(of_list({"--shard", fmt::format("{}/{}", index, count), "-o", in(into)}));
    ASSERT_EQ(made.code, 0) << made.err;
  }
  void make_parts() const {
    make_part(1, 2, "part1");
    make_part(2, 2, "part2");
  }
  std::string refused(const std::vector<std::string>& parts, ExitCode code,
                      const std::string& word) const {
    std::vector<std::string> words{"merge", "-o", in("merged")};
    for (const std::string& part : parts) words.push_back(in(part));
    std::string line = expect_refusal(words, code, word);
    EXPECT_FALSE(fs::exists(in("merged"))) << "nothing was begun";
    return line;
  }

  RecordingFolder folder_;

 private:
  void write_list() const { folder_.write("list.txt", "# two days\r\ntuesday\n\n  monday \n"); }

  static fs::path filmed() {
    fs::path out = truth::temporary_path("films_of_two_days");
    const std::vector<truth::RecordingOptions> days = two_days();
    const std::vector<truth::World> worlds = truth::make_recordings(small_robot(), days);
    for (std::size_t k = 0; k < days.size(); ++k) {
      fs::create_directories(out / days[k].name);
      truth::write_recording(out / days[k].name, worlds[k],
                             {.frame_rate_hz = kRateHz, .seed = k + 1});
    }
    return out;
  }
};

TEST_F(Shards, GiveTheBytesOfTheRunInOnePiece) {
  film();
  const Outcome whole = run(of_list({"-o", in("whole")}));
  ASSERT_EQ(whole.code, 0) << whole.err;
  make_parts();
  EXPECT_FALSE(fs::exists(in("part1") + "/observations_tuesday.csv"));
  const Outcome merged = run({"merge", in("part2"), in("part1"), "-o", in("merged"), "--quiet"});
  ASSERT_EQ(merged.code, 0) << merged.err;
  for (const char* name :
       {"robot.urdf", "structure.json", "calibration.json", "residuals.csv", "tracks.csv",
        "joint_values.csv", "observations_monday.csv", "observations_tuesday.csv", "result.json"})
    EXPECT_EQ(read_text_file(in("merged") + "/" + name), read_text_file(in("whole") + "/" + name))
        << name;
  const ProductCheck check = check_products(in("part1"));
  EXPECT_TRUE(!check.done || check.passed) << check.words;
}

TEST_F(Shards, MergeTakesDetectionFromThePartsAndTraceGoesOn) {
  film();
  make_parts();
  std::vector<std::string> stages;
  const CalledCommand merged =
      call_command({"merge", in("part1"), in("part2"), "-o", in("merged")},
                   [&](std::string_view stage, int, int) { stages.emplace_back(stage); });
  ASSERT_EQ(merged.code, ExitCode::kDone) << merged.message;
  EXPECT_FALSE(stages.empty());
  for (const std::string& stage : stages)
    EXPECT_EQ(stage.find("markers"), std::string::npos) << "a video was looked through";
  // The folder is that of a run, whichever way it came about.
  EXPECT_EQ(run({"trace", in("merged"), "--quiet"}).code, 0);
}

TEST_F(Shards, PathsAreSeenFromWhereTheShardsWere) {
  record();
  const fs::path here = fs::current_path();
  fs::current_path(folder_.path());
  const Outcome first = run({"run", "@list.txt", "--no-trace", "--shard", "1/2", "-o", "part1"});
  const Outcome second = run({"run", "@list.txt", "--no-trace", "--shard", "2/2", "-o", "part2"});
  fs::current_path(here);
  ASSERT_EQ(first.code + second.code, 0) << first.err << second.err;
  const Outcome merged = run({"merge", in("part1"), in("part2"), "-o", in("merged"), "--quiet"});
  ASSERT_EQ(merged.code, 0) << merged.err;
  const auto seen_from = [&] {
    return json::parse(read_text_file(in("merged") + "/run.json")).at("working_folder");
  };
  const json of_shards = seen_from();
  EXPECT_TRUE(fs::equivalent(of_shards.get<std::string>(), folder_.path()));
  static_cast<void>(run({"trace", in("merged"), "--quiet"}));
  EXPECT_EQ(seen_from(), of_shards) << "a second trace finds them, too";
}

TEST_F(Shards, APartGoesOnWhereItWasCutOff) {
  film();
  make_part(1, 2, "part1");
  const auto written = fs::last_write_time(in("part1") + "/observations_monday.csv");
  fs::remove(in("part1") + "/part.json");  // as a kill leaves it
  const Outcome again = run(of_list({"--shard", "1/2", "-o", in("part1"), "--json"}));
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(json::parse(again.out).at("shard"), "1/2");
  EXPECT_GE(fs::last_write_time(in("part1") + "/observations_monday.csv"), written);
  EXPECT_TRUE(fs::exists(in("part1") + "/part.json"));
}

TEST_F(Shards, WhatIsWrongWithThePartsIsOneLine) {
  record();
  make_parts();
  // Of tables nothing need be kept.
  EXPECT_EQ(json::parse(read_text_file(in("part1") + "/part.json")).at("parts").size(), 1U);
  const std::string missing = refused({"part1"}, ExitCode::kBadRequest, "shard 2/2 is missing");
  EXPECT_NE(missing.find("--shard 2/2"), std::string::npos) << "the command that makes it";
  make_part(1, 2, "again");
  refused({"part1", "again", "part2"}, ExitCode::kBadRequest, "shard 1/2");
  make_part(2, 3, "of_three");
  refused({"part1", "of_three"}, ExitCode::kBadRequest, "another run");
  ASSERT_EQ(run(of_list({"--shard", "2/2", "--folds", "3", "-o", in("folds")})).code, 0);
  refused({"part1", "folds"}, ExitCode::kBadRequest, "options");
  refused({"part1", "monday"}, ExitCode::kBadInput, "part.json");

  const std::string file = in("part2") + "/part.json";
  const std::string text = read_text_file(file);
  write_file_atomically(file, text.substr(0, text.size() / 2));
  refused({"part1", "part2"}, ExitCode::kBadInput, "cut off");
  json other = json::parse(text);
  other["version"] = "0.0.7";
  write_file_atomically(file, other.dump());
  refused({"part1", "part2"}, ExitCode::kBadInput, "0.0.7");
  other = json::parse(text);
  other["parts"][0].erase("inputs");
  write_file_atomically(file, other.dump());
  refused({"part1", "part2"}, ExitCode::kBadInput, "missing in it");
  write_file_atomically(file, text);

  const std::string joints = in("tuesday") + "/joints.csv";
  write_file_atomically(joints, read_text_file(joints) + "\n");
  const std::string changed = refused({"part1", "part2"}, ExitCode::kBadInput, "joints.csv");
  EXPECT_NE(changed.find("--shard 2/2"), std::string::npos) << changed;
  folder_.write("list.txt", "monday\ntuesday\npart1/../monday/../other\n");
  fs::copy(in("tuesday"), in("other"));
  refused({"part1", "part2"}, ExitCode::kBadInput, "list");
}

TEST_F(Shards, WhatWasDetectedAndCutOffIsNoPart) {
  film();
  make_parts();
  const std::string table = in("part2") + "/observations_tuesday.csv";
  const std::string text = read_text_file(table);
  write_file_atomically(table, text.substr(0, text.size() / 2));
  refused({"part1", "part2"}, ExitCode::kBadInput, "observations_tuesday.csv");
}

TEST_F(Shards, WhatCannotBeSharedOutIsRefused) {
  record();
  for (const char* shard : {"3/2", "0/2", "2", "1/2/3", "-1/2", "a/b", "1/ 2"})
    expect_refusal(of_list({"--shard", shard}), ExitCode::kBadRequest, "no shard");
  expect_refusal({"run", in("monday"), "--shard", "1/2", "-o", in("x")}, ExitCode::kBadRequest,
                 "one recording");
  expect_refusal(of_list({"--shard", "1/2", "-o", in("monday")}), ExitCode::kBadRequest, "monday");
  expect_refusal(of_list({"--shard", "1/2", "--fail-on", "nonsense>1", "-o", in("x")}),
                 ExitCode::kBadRequest, "nonsense");
  expect_refusal({"run", "@" + in("nowhere.txt")}, ExitCode::kBadInput, "nowhere.txt");
  folder_.write("list.txt", "# nothing\n");
  expect_refusal(of_list({}), ExitCode::kBadInput, "lists no recordings");
}

TEST_F(Shards, MoreShardsThanRecordingsAreEmptyParts) {
  record();
  make_part(3, 3, "none");
  EXPECT_TRUE(json::parse(read_text_file(in("none") + "/part.json")).at("parts").empty());
}

TEST(Shard, EveryPieceIsOfOne) {
  for (std::size_t k = 0; k < 7; ++k) {
    int held = 0;
    for (int i = 1; i <= 3; ++i) held += (Shard{i, 3}.holds(k)) ? 1 : 0;
    EXPECT_EQ(held, 1) << k;
  }
  EXPECT_EQ(parse_shard("2/3"), (Shard{2, 3}));
}

}  // namespace
}  // namespace kinescope
