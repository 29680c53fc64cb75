// SPDX-License-Identifier: Apache-2.0
//
// Poses of the flange as controllers write them: every way of writing gives the same poses.
#include <functional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "app/io/recording.h"
#include "kinematics/core/rng.h"
#include "tests/app/io/recording_folder.h"

namespace kinescope {
namespace {

std::vector<Pose> poses() {
  Rng rng = Rng::from_name("FlangeFile");
  std::vector<Pose> out;
  for (int i = 0; i < 8; ++i)
    out.push_back({exp_rotation(rng.unit3() * rng.uniform(0.2, 2.5)), rng.normal3(0.4)});
  return out;
}

class FlangeFile : public testing::Test {
 protected:
  /// The table's usual reading.
  FlangeReading read(const std::string& header,
                     const std::function<std::vector<double>(const Pose&)>& numbers) {
    std::string text = header + "\n";
    int row = 0;
    for (const Pose& pose : poses())
      text += fmt::format("{},{:.9f}\n", row++, fmt::join(numbers(pose), ","));
    folder_.write("flange.csv", text);
    return read_flange(folder_.path() / "flange.csv", std::nullopt).found.front();
  }

  static void expect_poses(const FlangeReading& reading) {
    const std::vector<Pose> expected = poses();
    ASSERT_EQ(reading.log.poses.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const Vector6d off = log_pose(expected[i].inverse() * reading.log.poses[i]);
      EXPECT_LT(off.norm(), 1e-6) << reading.rotation << ", row " << i;  // nine decimals
    }
  }

  RecordingFolder folder_;
};

std::vector<double> position(const Pose& pose) {
  return {pose.translation.x(), pose.translation.y(), pose.translation.z()};
}

TEST_F(FlangeFile, KawasakisAnglesAreZyzAndTheirThirdIsNoTime) {
  const auto numbers = [](const Pose& pose) {
    const Eigen::Vector3d oat = pose.matrix3().eulerAngles(2, 1, 2);
    std::vector<double> out = position(pose);
    out.insert(out.end(), oat.begin(), oat.end());
    return out;
  };
  for (const char* header : {"t,X,Y,Z,O,A,T", "index,x,y,z,o,a,t", "t,x,y,z,o,a,t2"}) {
    const FlangeReading reading = read(header, numbers);
    EXPECT_TRUE(reading.rotation.starts_with("O, A, T")) << reading.rotation;
    expect_poses(reading);
  }
}

TEST_F(FlangeFile, MatricesAreReadAsTheirNumbersSay) {
  const auto numbers = [](int rows, bool by_column) {
    return [=](const Pose& pose) {
      const Eigen::Matrix4d T = pose.matrix4();
      std::vector<double> out;
      for (int k = 0; k < 4 * rows; ++k)
        out.push_back(by_column ? T(k % rows, k / rows) : T(k / 4, k % 4));
      return out;
    };
  };
  const std::string sixteen = "m0,m1,m2,m3,m4,m5,m6,m7,m8,m9,m10,m11,m12,m13,m14,m15";
  const std::string named = "T00,T01,T02,T03,T10,T11,T12,T13,T20,T21,T22,T23";
  expect_poses(read("t," + sixteen, numbers(4, false)));
  expect_poses(read("t," + named, numbers(3, false)));
  const FlangeReading by_column = read("t," + sixteen, numbers(4, true));
  EXPECT_EQ(by_column.rotation, "matrix m0 to m15, column by column");
  expect_poses(by_column);
  expect_poses(read("t," + named, numbers(3, true)));
  expect_poses(read("t,x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33", [](const Pose& pose) {
    std::vector<double> out = position(pose);
    for (int k = 0; k < 9; ++k) out.push_back(pose.matrix3()(k / 3, k % 3));
    return out;
  }));
}

TEST_F(FlangeFile, NumbersThatAreNoMatrixAreRefused) {
  folder_.write("flange.csv",
                "t,T00,T01,T02,T03,T10,T11,T12,T13,T20,T21,T22,T23\n0,1,2,3,4,5,6,7,8,9,1,2,3\n");
  EXPECT_NE(folder_
                .refusal_of([&] {
                  static_cast<void>(read_flange(folder_.path() / "flange.csv", std::nullopt));
                })
                .find("the 12 columns t00 to t23 hold no pose as a matrix"),
            std::string::npos);
}

}  // namespace
}  // namespace kinescope
