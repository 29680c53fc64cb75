// SPDX-License-Identifier: Apache-2.0
//
// What a dataset says of itself, and what is wrong with datasets.
#include "kinematics/datasets/dataset.h"

#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/datasets/dataset_files.h"
#include "kinematics/datasets/dataset_log.h"
#include "tests/truth/dataset_writer.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::datasets {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kTop = "observation.images.top";

truth::DatasetFields two_episodes(const std::string& version) {
  truth::DatasetFields fields;
  fields.version = version;
  fields.joints = {"pan.pos", "lift.pos"};
  fields.cameras = {kTop};
  for (const float start : {0.0F, 10.0F}) {
    truth::DatasetEpisode episode;
    for (int frame = 0; frame < 5; ++frame) {
      const auto value = start + static_cast<float>(frame);
      episode.state.push_back({value, -value});
      episode.action.push_back({value + 0.5F, -value});
    }
    fields.episodes.push_back(episode);
  }
  return fields;
}

/// A dataset of one test.
class DatasetTest : public testing::Test {
 protected:
  fs::path make(const truth::DatasetFields& fields) {
    const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
    const fs::path folder = truth::temporary_path(std::string("dataset_") + test->name());
    fs::remove_all(folder);
    truth::write_dataset(folder, fields);
    return folder;
  }

  static void change_info(const fs::path& folder, const std::string& pointer, const json& value) {
    const fs::path file = folder / "meta/info.json";
    json info = json::parse(read_text_file(file));
    info[json::json_pointer(pointer)] = value;
    write_file_atomically(file, info.dump());
  }

  /// What reading the rows ends with, one line.
  static std::string answer_of(const fs::path& path) {
    try {
      const auto source = dataset_source(path);
      if (!source) return "no dataset";
      static_cast<void>(read_signals(*source));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      const std::string answer = error.what();
      EXPECT_EQ(answer.find('\n'), std::string::npos);
      EXPECT_TRUE(answer.ends_with(")")) << "a remedy: " << answer;
      return answer;
    }
    return "accepted";
  }

  static void expect_answer(const fs::path& path, const std::string& part) {
    const std::string answer = answer_of(path);
    EXPECT_NE(answer.find(part), std::string::npos) << answer;
  }
};

TEST_F(DatasetTest, OfBothVersionsHoldsTheSame) {
  for (const char* version : {"v2.1", "v3.0"}) {
    SCOPED_TRACE(version);
    const fs::path folder = make(two_episodes(version));
    const Dataset dataset = read_dataset(folder);
    EXPECT_EQ(dataset.version, version);
    EXPECT_EQ(dataset.robot_type, "so101_follower");
    EXPECT_EQ(dataset.frame_rate_hz, 30.0);
    ASSERT_EQ(dataset.episodes.size(), 2U);
    EXPECT_EQ(dataset.episodes[1].frames, 5U);
    EXPECT_EQ(dataset.episodes[1].tasks, std::vector<std::string>{"move about"});
    const VideoPart& video = dataset.episodes[1].videos.at(kTop);
    EXPECT_EQ(video.file, truth::video_of_dataset(folder, two_episodes(version), kTop, 1));
    EXPECT_EQ(video.from_s, std::string(version) == "v3.0" ? 5.0 / 30.0 : 0.0);
    EXPECT_TRUE(dataset.warnings.empty());
    EXPECT_EQ(answer_of(folder), "accepted");
  }
}

TEST_F(DatasetTest, IsNamedWithCameraAndEpisodes) {
  const fs::path folder = make(two_episodes("v2.1"));
  const auto named = [&](const std::string& ending) {
    return dataset_source(folder.string() + ending);
  };
  EXPECT_FALSE(dataset_source(folder / "meta"));
  EXPECT_FALSE(named(":"));
  EXPECT_EQ(named("/")->folder, folder);
  EXPECT_EQ(named("")->path(), folder);
  for (const std::string& ending :
       {":" + kTop, std::string(":1"), std::string(":0-1"), ":" + kTop + ":1"}) {
    ASSERT_TRUE(named(ending));
    EXPECT_EQ(named(ending)->path().string(), folder.string() + ending);
  }
  EXPECT_EQ(named(":" + kTop + ":1")->camera, kTop);
  EXPECT_EQ(named(":" + kTop + ":1")->episodes->first, 1U);
  EXPECT_EQ(named(":0-1")->episodes->last, 1U);
}

TEST_F(DatasetTest, SaysWhichCamerasItHas) {
  truth::DatasetFields fields = two_episodes("v3.0");
  const std::string wrist = "observation.images.wrist";
  fields.cameras.push_back(wrist);
  const fs::path folder = make(fields);
  const Dataset dataset = read_dataset(folder);
  const auto refusal = [&](const std::string& camera) -> std::string {
    try {
      return choose_camera(dataset, {folder, camera, {}}).name;
    } catch (const Error& error) {
      return error.what();
    }
  };
  EXPECT_NE(refusal("").find("holds 2 cameras: " + kTop + ", " + wrist), std::string::npos)
      << refusal("");
  EXPECT_NE(refusal("").find("name the one that stands still and sees the markers: " +
                             folder.string() + ":" + kTop),
            std::string::npos);
  EXPECT_EQ(refusal(wrist), wrist);
  EXPECT_NE(refusal("front").find("no such camera (the dataset has " + kTop), std::string::npos);
  EXPECT_NE(refusal("action").find("is no video"), std::string::npos);
  // Depths are no images of markers.
  change_info(folder, "/features/" + wrist + "/info/video.is_depth_map", true);
  EXPECT_EQ(choose_camera(read_dataset(folder), {folder, {}, {}}).name, kTop);
  change_info(folder, "/features/" + kTop + "/dtype", "image");
  try {
    static_cast<void>(choose_camera(read_dataset(folder), {folder, {}, {}}));
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("as single images, which are not read"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(DatasetTest, OfAnotherVersionIsRefused) {
  const fs::path folder = make(two_episodes("v2.1"));
  change_info(folder, "/codebase_version", "v1.6");
  expect_answer(folder, "info.json: is of LeRobot v1.6, which is not read (v2.0, v2.1 and v3.0");
  change_info(folder, "/codebase_version", nullptr);
  expect_answer(folder, "has no codebase_version");
  write_file_atomically(folder / "meta/info.json", "[1, 2");
  expect_answer(folder, "info.json: is no JSON object");
}

TEST_F(DatasetTest, PathsThatLeadOutAreRefused) {
  for (const char* path : {"/etc/passwd", "../{episode_index}.parquet", "data/../../x.parquet"}) {
    const fs::path folder = make(two_episodes("v2.1"));
    change_info(folder, "/data_path", path);
    expect_answer(folder, "leads out of the dataset");
  }
  const fs::path folder = make(two_episodes("v3.0"));
  change_info(folder, "/data_path", "data/{secret}.parquet");
  expect_answer(folder, "an unknown field 'secret' in the path");
  change_info(folder, "/data_path", "data/{chunk_index:999d}.parquet");
  expect_answer(folder, "an unknown format '999d' in the path");
  change_info(folder, "/data_path", "data/{chunk_index.parquet");
  expect_answer(folder, "a brace without its other");
  // A camera's name is part of a path, too.
  const json camera = {{"dtype", "video"}, {"shape", {480, 640, 3}}};
  const fs::path other = make(two_episodes("v2.1"));
  change_info(other, "/features/..~1..~1x", camera);
  expect_answer(other, "leads out of the dataset");
}

TEST_F(DatasetTest, NumbersThatLieAreRefused) {
  const fs::path folder = make(two_episodes("v2.1"));
  change_info(folder, "/features/observation.state/shape/0", 3);
  expect_answer(folder, "feature 'observation.state': names is a list of 2 for a shape of 3");
  change_info(folder, "/features/observation.state/names", nullptr);
  expect_answer(folder, "observation.state has 2 elements, and info.json declares 3");
  change_info(folder, "/features/observation.state/shape/0", -1);
  expect_answer(folder, "shape is no list of sizes");
  for (const json& rate : {json(0), json(-30), json(1e300), json("30")}) {
    const fs::path again = make(two_episodes("v2.1"));
    change_info(again, "/fps", rate);
    expect_answer(again, "fps is ");
  }
  const fs::path more = make(two_episodes("v3.0"));
  change_info(more, "/total_episodes", 7);
  EXPECT_EQ(read_dataset(more).warnings.size(), 1U);
  change_info(more, "/total_episodes", -7);
  expect_answer(more, "total_episodes is -7, which is no count");
}

TEST_F(DatasetTest, EpisodesThatAreMissingAreNamed) {
  const fs::path folder = make(two_episodes("v2.1"));
  expect_answer(folder.string() + ":7", "holds no frame: episodes are 0 to 1");
  const fs::path rows = folder / "data/chunk-000/episode_000001.parquet";
  const std::string whole = read_text_file(rows);
  write_file_atomically(rows, whole.substr(0, whole.size() / 2));
  expect_answer(folder, "episode_000001.parquet: the file is damaged: it is cut off");
  EXPECT_EQ(answer_of(folder.string() + ":0"), "accepted");
  fs::remove(rows);
  expect_answer(folder, "episode_000001.parquet: no such file");
  write_file_atomically(folder / "meta/episodes.jsonl", "{\"episode_index\": 0, \"length\": 6}\n");
  expect_answer(folder, "has 5 rows of episode 0, which is listed with 6");
  write_file_atomically(folder / "meta/episodes.jsonl", "{\"episode_index\": 0}\n");
  expect_answer(folder, "episodes.jsonl:1: has no length");
  write_file_atomically(folder / "meta/episodes.jsonl",
                        "{\"episode_index\": 0, \"length\": 5}\n"
                        "{\"episode_index\": 0, \"length\": 5}\n");
  expect_answer(folder, "episode 0 is listed twice");
  fs::remove(folder / "meta/episodes.jsonl");
  expect_answer(folder, "episodes.jsonl: no such file");
  const fs::path other = make(two_episodes("v3.0"));
  fs::remove_all(other / "meta/episodes");
  expect_answer(other, "lists no episode");
}

TEST_F(DatasetTest, WithoutJointsIsRefused) {
  const fs::path folder = make(two_episodes("v2.1"));
  const fs::path file = folder / "meta/info.json";
  json info = json::parse(read_text_file(file));
  info["features"].erase("observation.state");
  write_file_atomically(file, info.dump());
  expect_answer(folder, "has no observation.state, only action, episode_index");
}

}  // namespace
}  // namespace kinescope::datasets
