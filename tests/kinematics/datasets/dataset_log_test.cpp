// SPDX-License-Identifier: Apache-2.0
//
// Rows of datasets as joint logs and torque logs.
#include "kinematics/datasets/dataset_log.h"

#include <cmath>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/recorded/container.h"
#include "kinematics/recorded/recorded_log.h"
#include "tests/truth/dataset_writer.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::datasets {
namespace {

namespace fs = std::filesystem;

/// Two joints that move, 30 frames an episode.
truth::DatasetFields arm(int episodes) {
  truth::DatasetFields fields;
  fields.joints = {"pan.pos", "lift.pos"};
  for (int e = 0; e < episodes; ++e) {
    truth::DatasetEpisode episode;
    for (int frame = 0; frame < 30; ++frame) {
      const auto t = static_cast<float>(frame) / 30.0F;
      episode.state.push_back({std::sin(t) + static_cast<float>(e), t});
      episode.action.push_back({std::sin(t + 0.1F) + static_cast<float>(e), t + 0.1F});
    }
    fields.episodes.push_back(episode);
  }
  return fields;
}

fs::path written(const std::string& name, const truth::DatasetFields& fields) {
  const fs::path folder = truth::temporary_path(name);
  fs::remove_all(folder);
  truth::write_dataset(folder, fields);
  return folder;
}

TEST(DatasetLog, IsAJointLogWithCommands) {
  const JointLog log = recorded::read_joint_log(written("arm", arm(1)));
  EXPECT_EQ(log.channels, (std::vector<std::string>{"pan", "lift", "pan_command", "lift_command"}));
  ASSERT_EQ(log.size(), 30U);
  // Stamps of 32 bits are the frames' numbers by the rate.
  for (std::size_t row = 0; row < log.size(); ++row)
    EXPECT_EQ(log.times_s[row], static_cast<double>(row) / 30.0);
  EXPECT_NEAR(log.values(7, 0), std::sin(7.0 / 30.0), 1e-7);
  EXPECT_NEAR(log.values(7, 3), 7.0 / 30.0 + 0.1, 1e-7);
  EXPECT_TRUE(log.warnings.empty());
}

TEST(DatasetLog, OfSeveralEpisodesJoinsThem) {
  for (const char* version : {"v2.1", "v3.0"}) {
    SCOPED_TRACE(version);
    truth::DatasetFields fields = arm(3);
    fields.version = version;
    const fs::path folder = written("arms", fields);
    const JointLog log = recorded::read_joint_log(folder);
    ASSERT_EQ(log.size(), 90U);
    EXPECT_DOUBLE_EQ(log.times_s[30] - log.times_s[29], 1.0 / 30.0 + kBetweenEpisodesS);
    EXPECT_NEAR(log.values(30, 0), 1.0, 1e-7);
    EXPECT_FALSE(interpolate(log, 0, log.times_s[29] + 0.5)) << "nothing between episodes";
    ASSERT_EQ(log.warnings.size(), 1U);
    EXPECT_NE(log.warnings[0].find("3 episodes with 90 frames are joined, 1 s apart"),
              std::string::npos)
        << log.warnings[0];
    const JointLog one = recorded::read_joint_log(folder.string() + ":1");
    ASSERT_EQ(one.size(), 30U);
    EXPECT_EQ(one.times_s.front(), 0.0);
    EXPECT_NEAR(one.values(0, 0), 1.0, 1e-7);
    EXPECT_TRUE(one.warnings.empty());
  }
}

TEST(DatasetLog, IsATorqueLogOfTrajectories) {
  truth::DatasetFields fields = arm(2);
  for (truth::DatasetEpisode& episode : fields.episodes)
    episode.effort = truth::FloatRows(episode.state.size(), {0.25F, 2.0F});
  const fs::path folder = written("efforts", fields);
  const ChannelTable table = recorded::read_channel_table(folder);
  EXPECT_EQ(table.names, (std::vector<std::string>{
                             "t", "episode", "pan_position", "lift_position", "pan_effort",
                             "lift_effort", "pan_position_command", "lift_position_command"}));
  EXPECT_EQ(table.values(29, 1), 0.0);
  EXPECT_EQ(table.values(30, 1), 1.0);
  EXPECT_EQ(table.values(3, 5), 2.0);
  const JointLog log = recorded::read_joint_log(folder);
  EXPECT_EQ(log.torque_columns, (std::vector<std::string>{"tau_pan", "tau_lift"}));
  const recorded::TorqueColumns columns = recorded::torque_columns(log.source, "pan", "tau_pan");
  EXPECT_EQ(columns.position, "pan_position");
  EXPECT_EQ(columns.torque, "pan_effort");
  EXPECT_EQ(recorded::torque_columns(log.source, "pan_command", "tau_pan").position,
            "pan_position_command");
}

TEST(DatasetLog, SuffixesSayWhichQuantity) {
  truth::DatasetFields fields = arm(1);
  fields.joints = {"pan.vel", "pan.current"};
  ChannelTable table = recorded::read_channel_table(written("suffixes", fields));
  // The command of a speed or a current is none of a position.
  EXPECT_EQ(table.names, (std::vector<std::string>{"t", "episode", "pan_velocity", "pan_current"}));
  fields.joints = {"grip", "grip"};
  table = recorded::read_channel_table(written("twice", fields));
  EXPECT_EQ(table.names[2], "grip_position");
  EXPECT_EQ(table.names[3], "grip_2_position");
  fields.joints = {};
  table = recorded::read_channel_table(written("unnamed", fields));
  EXPECT_EQ(table.names[3], "joint2_position");
}

TEST(DatasetLog, WithNaNLeavesTheRowOut) {
  truth::DatasetFields fields = arm(1);
  fields.episodes[0].state[4][1] = std::nanf("");
  const JointLog log = recorded::read_joint_log(written("hole", fields));
  EXPECT_EQ(log.size(), 29U);
  ASSERT_EQ(log.warnings.size(), 1U);
  EXPECT_NE(log.warnings[0].find("hole:5"), std::string::npos) << log.warnings[0];
  for (auto& row : fields.episodes[0].state) row[1] = std::nanf("");
  fields.episodes[0].state[0][1] = 0.0F;
  EXPECT_THROW(static_cast<void>(recorded::read_joint_log(written("holes", fields))), Error);
}

TEST(DatasetLog, StandsForItsFiles) {
  truth::DatasetFields fields = arm(2);
  fields.cameras = {"observation.images.top"};
  const fs::path folder = written("parts", fields);
  const std::vector<fs::path> rows = recorded::parts_of(folder.string() + ":1");
  EXPECT_EQ(rows, (std::vector<fs::path>{folder / "meta/info.json", folder / "meta/episodes.jsonl",
                                         folder / "data/chunk-000/episode_000001.parquet"}));
  const std::vector<fs::path> videos =
      recorded::parts_of(folder.string() + ":observation.images.top");
  ASSERT_EQ(videos.size(), 4U);
  EXPECT_EQ(videos[3], truth::video_of_dataset(folder, fields, fields.cameras[0], 1));
  EXPECT_EQ(recorded::short_name(folder.string() + ":0-1"), "parts:0-1");
}

}  // namespace
}  // namespace kinescope::datasets
