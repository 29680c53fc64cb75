// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/join_logs.h"

#include <gtest/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

JointLog log_of(const std::string& source, const std::vector<std::string>& channels,
                const std::vector<double>& times_s) {
  JointLog out;
  out.source = source;
  out.channels = channels;
  out.times_s = times_s;
  out.values.resize(static_cast<Eigen::Index>(times_s.size()),
                    static_cast<Eigen::Index>(channels.size()));
  for (Eigen::Index r = 0; r < out.values.rows(); ++r)
    for (Eigen::Index c = 0; c < out.values.cols(); ++c)
      out.values(r, c) = times_s[static_cast<std::size_t>(r)] +
                         (channels[static_cast<std::size_t>(c)] == "a" ? 10.0 : 20.0);
  return out;
}

TEST(JoinLogs, GoesOnInTheFirstOnesOrderOfChannels) {
  const JointLog joined = joined_logs(log_of("A", {"a", "b"}, {0.0, 0.1, 0.2}),
                                      log_of("B", {"b", "a"}, {0.0, 0.1}), 5.0, true);
  EXPECT_EQ(joined.times_s, (std::vector<double>{0.0, 0.1, 0.2, 5.0, 5.1}));
  EXPECT_EQ(joined.channels, (std::vector<std::string>{"a", "b"}));
  EXPECT_DOUBLE_EQ(joined.values(3, 0), 10.0);
  EXPECT_DOUBLE_EQ(joined.values(4, 1), 20.1);
  EXPECT_TRUE(joined.is_joined_between(0.2, 5.0));
}

TEST(JoinLogs, PiecesOfOneLogAreInterpolatedOver) {
  const JointLog joined =
      joined_logs(log_of("A", {"a"}, {0.0, 0.1, 0.2}), log_of("B", {"a"}, {0.3, 0.4}), 0.0, false);
  EXPECT_TRUE(joined.joined_at_s.empty());
  const auto between = interpolate(joined, 0, 0.25);
  ASSERT_TRUE(between.has_value());
  EXPECT_NEAR(between->value, 10.25, 1e-12);
}

TEST(JoinLogs, NamesTheChannelsThatAreMissing) {
  const JointLog first = log_of("A", {"a", "b"}, {0.0, 0.1});
  for (const bool second_lacks : {true, false}) {
    const JointLog other = log_of("B", {"a"}, {0.0, 0.1});
    try {
      static_cast<void>(second_lacks ? joined_logs(first, other, 5.0, true)
                                     : joined_logs(other, first, 5.0, true));
      FAIL() << "joined";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      EXPECT_NE(std::string(error.what()).find("'b'"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace kinescope
