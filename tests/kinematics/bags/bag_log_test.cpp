// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "kinematics/bags/bag_contents.h"
#include "kinematics/recorded/recorded_log.h"
#include "tests/truth/bag_writer.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::bags {
namespace {

namespace fs = std::filesystem;
constexpr std::int64_t kStart = 1'700'000'000'000'000'000;
constexpr std::int64_t kMillisecond = 1'000'000;
const std::string kType = "sensor_msgs/msg/JointState";

/// An arm at 100 Hz and, where asked for, a gripper at 25 Hz by another publisher on the same
/// topic.
struct BagOptions {
  std::int64_t header_clock_ns = kStart;  ///< of the first message
  bool stamped = true;
  bool gripper = false;
  bool shuffled = false;  ///< every second pair of messages comes in the other order
};

fs::path bag(const std::string& name, const BagOptions& options = {}) {
  const fs::path path = truth::temporary_path(name);
  truth::BagWriter writer(path);
  const auto write = [&](int k) {
    const std::int64_t t = 10 * kMillisecond * k;
    const std::int64_t header = options.stamped ? options.header_clock_ns + t : 0;
    writer.write("/joint_states", kType, kStart + t + 3 * kMillisecond,
                 truth::joint_state(header, {"b", "a"}, {0.01 * k, std::sin(0.01 * k)},
                                    {1.0, std::cos(0.01 * k)}, {0.5, 2.0}));
    if (options.gripper && k % 4 == 0) {
      writer.write("/joint_states", kType, kStart + t + 4 * kMillisecond,
                   truth::joint_state(header, {"g"}, {0.002 * k}));
    }
  };
  for (int k = 0; k < 200; k += 2) {
    const bool other_way = options.shuffled && k % 4 == 0;
    write(other_way ? k + 1 : k);
    write(other_way ? k : k + 1);
  }
  writer.finish();
  return path;
}

TEST(BagLog, IsAJointLog) {
  const JointLog log = recorded::read_joint_log(bag("arm.mcap"));
  ASSERT_EQ(log.size(), 200U);
  EXPECT_EQ(log.channels, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(log.torque_columns, (std::vector<std::string>{"tau_a", "tau_b"}));
  // The first message came 3 ms after its stamp, and begins the bag's time.
  EXPECT_NEAR(log.times_s.front(), -0.003, 1e-9);
  EXPECT_NEAR(log.times_s[100] - log.times_s[0], 1.0, 1e-9);
  EXPECT_EQ(log.values(50, 0), std::sin(0.5));
  EXPECT_EQ(log.values(50, 1), 0.5);
  EXPECT_TRUE(log.warnings.empty());
}

TEST(BagLog, IsATorqueLog) {
  const ChannelTable table = recorded::read_channel_table(bag("torques.mcap"));
  EXPECT_EQ(table.names, (std::vector<std::string>{"t", "a_position", "b_position", "a_velocity",
                                                   "b_velocity", "a_effort", "b_effort"}));
  EXPECT_EQ(table.values(30, 1), std::sin(0.3));
  EXPECT_EQ(table.values(30, 5), 2.0);
  EXPECT_EQ(table.rows(), 200);
}

TEST(BagLog, ClocksThatDifferAreMovedToTheRecorders) {
  const JointLog log =
      recorded::read_joint_log(bag("simulated.mcap", {.header_clock_ns = 40 * kMillisecond}));
  EXPECT_NEAR(log.times_s.front(), 0.0, 1e-6);
  EXPECT_NEAR(log.times_s[100] - log.times_s[0], 1.0, 1e-9);
  ASSERT_EQ(log.warnings.size(), 1U);
  EXPECT_NE(log.warnings[0].find("moved to it"), std::string::npos) << log.warnings[0];
}

TEST(BagLog, WithoutStampsTheRecordersAreUsed) {
  const JointLog log = recorded::read_joint_log(bag("unstamped.mcap", {.stamped = false}));
  EXPECT_EQ(log.times_s.front(), 0.0);
  ASSERT_EQ(log.warnings.size(), 1U);
  EXPECT_NE(log.warnings[0].find("no stamps of its own"), std::string::npos) << log.warnings[0];
}

TEST(BagLog, JointsOfAnotherPublisherJoinInBetweenTheirMessages) {
  const JointLog log = recorded::read_joint_log(bag("gripper.mcap", {.gripper = true}));
  EXPECT_EQ(log.channels, (std::vector<std::string>{"a", "b", "g"}));
  ASSERT_EQ(log.size(), 197U);  // the gripper's last message is three before the arm's
  for (const Eigen::Index row : {0, 41, 190})
    EXPECT_NEAR(log.values(row, 2), 0.002 * static_cast<double>(row), 1e-9);
}

// Two topics stamped by one simulated clock, of which one takes longer to the recorder.
TEST(BagLog, TopicsOfAnotherClockStayTogether) {
  const fs::path path = truth::temporary_path("two_topics.mcap");
  truth::BagWriter writer(path);
  for (int k = 0; k < 100; ++k) {
    const std::int64_t t = 10 * kMillisecond * k;
    writer.write("/joint_states", kType, kStart + t + 2 * kMillisecond,
                 truth::joint_state(t + 1, {"a"}, {0.01 * k}));
    writer.write("/image_raw", "sensor_msgs/msg/Image", kStart + t + 80 * kMillisecond,
                 truth::image(t + 1, 2, 2, "mono8", 2, "grey"));
  }
  writer.finish();
  const Contents contents = read_contents(path);
  ASSERT_EQ(contents.images.size(), 1U);
  EXPECT_NEAR(contents.images[0].times_s[50], contents.joints[0].times_s[50], 1e-6);
  EXPECT_NEAR(contents.images[0].stamps.delay_s, 0.078, 1e-6);
}

TEST(BagLog, OneMessageWithoutAStampIsOne) {
  const fs::path path = truth::temporary_path("first_zero.mcap");
  truth::BagWriter writer(path);
  for (int k = 0; k < 100; ++k) {
    const std::int64_t t = kStart + 10 * kMillisecond * k;
    writer.write("/joint_states", kType, t + 5 * kMillisecond,
                 truth::joint_state(k == 0 ? 0 : t, {"a"}, {0.01 * k}));
  }
  writer.finish();
  const JointLog log = recorded::read_joint_log(path);
  ASSERT_EQ(log.size(), 100U);
  EXPECT_NEAR(log.times_s[1] - log.times_s[0], 0.01, 1e-9);
  EXPECT_TRUE(log.warnings.empty());
}

TEST(BagLog, CommandsDoNotJoinMeasurements) {
  const fs::path path = truth::temporary_path("commands.mcap");
  truth::BagWriter writer(path);
  for (int k = 0; k < 100; ++k) {
    const std::int64_t t = kStart + 10 * kMillisecond * k;
    writer.write("/joint_states", kType, t, truth::joint_state(t, {"a"}, {0.01 * k}));
    writer.write("/gripper/joint_commands", kType, t, truth::joint_state(t, {"g"}, {0.02 * k}));
  }
  writer.finish();
  const JointLog log = recorded::read_joint_log(path);
  EXPECT_EQ(log.channels, (std::vector<std::string>{"a"}));
  ASSERT_EQ(log.warnings.size(), 1U);
  EXPECT_NE(log.warnings[0].find("/gripper/joint_commands"), std::string::npos);
}

// A topic's joints, a message every `every` of 200 hundredths of a second.
struct Published {
  std::string topic;
  std::vector<std::string> names;
  double rate = 0.0;  ///< of all joints, rad/s
  int every = 1;
};

fs::path bag_of(const std::string& name, const std::vector<Published>& all) {
  const fs::path path = truth::temporary_path(name);
  truth::BagWriter writer(path);
  for (int k = 0; k <= 200; ++k) {
    const std::int64_t t = kStart + 10 * kMillisecond * k;
    for (const Published& one : all) {
      if (k % one.every != 0) continue;
      const std::vector<double> values(one.names.size(), one.rate * 0.01 * k);
      writer.write(one.topic, kType, t, truth::joint_state(t, one.names, values));
    }
  }
  writer.finish();
  return path;
}

TEST(BagLog, TwoArmsAreOneLog) {
  const JointLog log = recorded::read_joint_log(
      bag_of("two_arms.mcap", {{"/left/joint_states", {"l_a", "l_b"}, 0.1, 4},
                               {"/right/joint_states", {"r_a", "r_b"}, 0.2}}));
  EXPECT_EQ(log.channels, (std::vector<std::string>{"r_a", "r_b", "l_a", "l_b"}));
  ASSERT_EQ(log.size(), 201U) << "the denser clock";
  EXPECT_NEAR(log.values(41, 0), 0.082, 1e-9);
  EXPECT_NEAR(log.values(41, 2), 0.041, 1e-9);
  EXPECT_TRUE(log.warnings.empty());
}

TEST(BagLog, JointsThatTwoTopicsPublishAreThoseWithMostMessages) {
  const JointLog log = recorded::read_joint_log(
      bag_of("same_names.mcap", {{"/left/joint_states", {"a", "b"}, 0.1, 4},
                                 {"/hand/joint_states", {"g"}, 0.3},
                                 {"/right/joint_states", {"b", "a"}, 0.2},
                                 {"/slow/joint_states", {"g", "h"}, 0.4, 2}}));
  EXPECT_EQ(log.channels, (std::vector<std::string>{"a", "b", "g", "h"}));
  EXPECT_NEAR(log.values(40, 0), 0.08, 1e-9);
  EXPECT_NEAR(log.values(40, 2), 0.12, 1e-9);
  EXPECT_NEAR(log.values(40, 3), 0.16, 1e-9);
  ASSERT_EQ(log.warnings.size(), 2U);
  EXPECT_NE(log.warnings[0].find("/slow/joint_states with g are not used"), std::string::npos)
      << log.warnings[0];
  EXPECT_NE(log.warnings[1].find("/left/joint_states with a, b are not used"), std::string::npos)
      << log.warnings[1];
}

TEST(BagLog, OrderOfArrivalDoesNotMatter) {
  const JointLog straight = recorded::read_joint_log(bag("straight.mcap"));
  const JointLog shuffled = recorded::read_joint_log(bag("shuffled.mcap", {.shuffled = true}));
  EXPECT_EQ(shuffled.values, straight.values);
}

TEST(BagLog, CsvIsReadAsBefore) {
  const fs::path path = truth::temporary_path("plain.csv");
  std::ofstream(path) << "t,a\n0,0\n1,1\n2,3\n";
  EXPECT_EQ(recorded::read_joint_log(path).size(), 3U);
  EXPECT_EQ(recorded::read_channel_table(path).rows(), 3);
}

}  // namespace
}  // namespace kinescope::bags
