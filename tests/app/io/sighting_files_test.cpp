// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/app/io/recording_folder.h"

namespace kinescope {
namespace {

class SightingFiles : public testing::Test {
 protected:
  SightingFiles() { markers_.default_size_m = 0.05; }

  TagObservations corners(std::string_view text) {
    folder_.write("corners.csv", text);
    return read_corners(folder_.path() / "corners.csv", markers_);
  }
  ReadSightings<PoseTracks> read_poses_of(std::string_view text) {
    folder_.write("poses.csv", text);
    return read_poses(folder_.path() / "poses.csv");
  }
  PoseTracks poses(std::string_view text) { return read_poses_of(text).found; }
  PointObservations points(std::string_view text) {
    folder_.write("points.csv", text);
    return read_points(folder_.path() / "points.csv").found;
  }
  std::string corners_refusal(std::string_view text) {
    return folder_.refusal_of([&] { static_cast<void>(corners(text)); });
  }
  std::string poses_refusal(std::string_view text) {
    return folder_.refusal_of([&] { static_cast<void>(poses(text)); });
  }
  std::string points_refusal(std::string_view text) {
    return folder_.refusal_of([&] { static_cast<void>(points(text)); });
  }

  RecordingFolder folder_;
  MarkerSet markers_;
};

TEST_F(SightingFiles, CornersInAnyOrderOfRows) {
  const TagObservations found = corners(
      "t,tag,corner,u,v,sigma\n2.5,4,1,3,4,0.3\n2.5,4,0,1,2,0.4\n2.5,4,3,7,8,\n1.5,9,0,0,0,1\n1.5,"
      "9,1,1,0,1\n"
      "1.5,9,2,1,1,1\n1.5,9,3,0,1,1\n2.5,4,2,5,6,0.1\n");
  EXPECT_EQ(found.times_s, (std::vector<double>{1.5, 2.5}));
  ASSERT_EQ(found.observations.size(), 2U);
  EXPECT_EQ(found.observations[0].id, TagId{9});
  const TagObservation& tag = found.observations[1];
  EXPECT_EQ(tag.frame, 1);
  ASSERT_EQ(tag.corners_px.size(), 4U);
  for (int c = 0; c < 4; ++c) {
    EXPECT_EQ(tag.corners_px[static_cast<std::size_t>(c)], Eigen::Vector2d(2 * c + 1, 2 * c + 2));
  }
  // Root mean square of 0.4, 0.3, 0.1 and 0.1 where none is declared.
  EXPECT_NEAR(tag.sigma_px, std::sqrt((0.16 + 0.09 + 0.01 + 0.01) / 4.0), 1e-15);
}

TEST_F(SightingFiles, CornersTakeMoreColumns) {
  const TagObservations found = corners(
      "t,tag,corner,u,v,sigma,hamming,margin\n0,1,0,0,0,1,2,55\n0,1,1,1,0,1,2,55\n0,1,2,1,1,1,2,"
      "55\n"
      "0,1,3,0,1,1,2,55\n");
  EXPECT_EQ(found.observations[0].hamming, 2);
  EXPECT_EQ(found.observations[0].decision_margin, 55.0);
}

TEST_F(SightingFiles, CornersOfABoard) {
  markers_ = {};
  markers_.only_listed = true;
  markers_.boards[TagId{0}] = std::vector<Eigen::Vector3d>(2);
  const TagObservations found = corners("t,tag,corner,u,v\n0,0,0,5,6\n0,0,1,7,8\n0,3,0,1,1\n");
  ASSERT_EQ(found.observations.size(), 1U);
  EXPECT_EQ(found.observations[0].corners_px.size(), 2U);
  ASSERT_EQ(found.rejected.size(), 1U) << "tag 3 is not listed";
  EXPECT_EQ(found.rejected[0].id, TagId{3});
}

TEST_F(SightingFiles, CornersRefused) {
  const std::string head = "t,tag,corner,u,v,sigma\n";
  EXPECT_EQ(corners_refusal(head + "0,1,0,0,0,1\n0,1,1,0,0,1\n0,1,2,0,0,1\n"),
            "corners.csv:4: tag 1 at t = 0 has 3 corners of 4 (give all of them, or leave the "
            "sighting out)");
  EXPECT_NE(
      corners_refusal(head + "0,1,4,0,0,1\n").find("corners.csv:2: tag 1 at t = 0 has no corner 4"),
      std::string::npos);
  EXPECT_NE(corners_refusal(head + "0,1,0,0,0,1\n0,1,0,0,0,1\n")
                .find("corners.csv:3: tag 1 at t = 0 has its corner 0 twice"),
            std::string::npos);
  EXPECT_NE(corners_refusal(head + "0,-1,0,0,0,1\n").find("corners.csv:2: column 'tag' holds -1"),
            std::string::npos);
  EXPECT_NE(corners_refusal(head + "0,1.5,0,0,0,1\n").find("not a whole number"),
            std::string::npos);
  EXPECT_NE(corners_refusal(head + "0,1,0,nan,0,1\n").find("column 'u' holds 'nan'"),
            std::string::npos);
  EXPECT_NE(corners_refusal(head + "0,1,0,0,0,0\n").find("column 'sigma' holds 0"),
            std::string::npos);
  EXPECT_NE(corners_refusal("t,tag,u,v\n0,1,0,0\n").find("no column 'corner'"), std::string::npos);
  markers_.default_size_m = 0.0;
  EXPECT_NE(corners_refusal(head + "0,1,0,0,0,1\n").find("tag 1 has no declared size"),
            std::string::npos);
  markers_.only_listed = true;
  EXPECT_NE(corners_refusal(head + "0,1,0,0,0,1\n").find("holds no tag that tags.yaml lists"),
            std::string::npos);
}

TEST_F(SightingFiles, PosesWithTheirNoise) {
  const PoseTracks found = poses(
      "t,body,x,y,z,qx,qy,qz,qw,sigma_m,sigma_rad\n1,5,1,2,3,0,0,0.71,0.71,0.01,0.02\n0,5,0,0,0,0,"
      "0,0,-1,"
      ",\n"
      "0,2,0,0,0,1,0,0,0,,\n");
  EXPECT_EQ(found.times_s, (std::vector<double>{0.0, 1.0}));
  ASSERT_EQ(found.tracks.size(), 2U);
  EXPECT_EQ(found.tracks[0].id, TagId{2});
  const PoseSample& sample = found.tracks[1].samples[1];
  EXPECT_EQ(sample.frame, 1);
  EXPECT_EQ(sample.T_camera_marker.translation, Eigen::Vector3d(1, 2, 3));
  // A quarter turn about z, its quaternion made a unit one.
  EXPECT_LT((sample.T_camera_marker.rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY())
                .norm(),
            1e-15);
  EXPECT_NEAR(sample.covariance(0, 0), 4e-4, 1e-18) << "rotation first";
  EXPECT_NEAR(sample.covariance(5, 5), 1e-4, 1e-18);
  EXPECT_EQ(sample.covariance(0, 5), 0.0);
}

TEST_F(SightingFiles, PosesRefused) {
  const std::string head = "t,body,x,y,z,qx,qy,qz,qw\n";
  EXPECT_EQ(poses_refusal(head + "0,1,0,0,0,0,0,0,0\n"),
            "poses.csv:2: the quaternion has length 0 (columns qx, qy, qz, qw hold a unit "
            "quaternion; leave rows "
            "without a pose out)");
  EXPECT_NE(poses_refusal(head + "0,1,0,0,0,0,0,0,1\n0,1,0,0,0,0,0,0,1\n")
                .find("poses.csv:3: body 1 at t = 0 stands there twice"),
            std::string::npos);
  EXPECT_NE(poses_refusal(head + "0,1,,0,0,0,0,0,1\n").find("poses.csv:2: column 'x' holds ''"),
            std::string::npos);
  EXPECT_NE(poses_refusal("t,body,x,y,z\n0,1,0,0,0\n").find("no column 'qx'"), std::string::npos);
  EXPECT_NE(poses_refusal("t,body,x,y,z,qx,qy,qz,qw,sigma_m\n0,1,0,0,0,0,0,0,1,-1\n")
                .find("'sigma_m' holds -1"),
            std::string::npos);
}

/// Forty good rows of a body that moves, and one more.
std::string forty_poses(std::string_view row, double unit_m = 1.0) {
  std::string text = "t,body,x,y,z,qx,qy,qz,qw\n";
  for (int i = 0; i < 40; ++i) text += fmt::format("{},1,{},0,0,0,0,0,1\n", i, 0.01 * i * unit_m);
  return text + std::string(row) + "\n";
}

TEST_F(SightingFiles, AFewBadPosesAreLeftOut) {
  const std::map<std::string, std::string> bad = {
      {"41,1,nan,0,0,0,0,0,1", "column 'x' holds 'nan', not a finite number"},
      {"41,1,0,-2e6,0,0,0,0,1", "column 'y' holds -2e6, which is out of all reach"},
      {"41,1,0,0,0,0,0,0,1.02", "the quaternion has length 1.02"},
      {"41,ERR,0,0,0,0,0,0,1", "column 'body' holds 'ERR', not a whole number"},
      {"41,1,0,0,0", "5 cells where the header has 9"},
      {"39,1,0,0,0,0,0,0,1", "body 1 at t = 39 stands there twice"}};
  for (const auto& [row, complaint] : bad) {
    const ReadSightings<PoseTracks> read = read_poses_of(forty_poses(row));
    ASSERT_EQ(read.found.tracks.size(), 1U) << row;
    EXPECT_EQ(read.found.tracks[0].samples.size(), 40U) << row;
    ASSERT_EQ(read.warnings.size(), 1U) << row;
    EXPECT_TRUE(read.warnings[0].ends_with("poses.csv:42: " + complaint + ": left out"))
        << read.warnings[0];
  }
}

TEST_F(SightingFiles, ManyBadPosesAreRefused) {
  std::string rows;
  for (int i = 41; i < 45; ++i) rows += fmt::format("{},1,1e7,0,0,0,0,0,1\n", i);
  EXPECT_NE(poses_refusal(forty_poses(rows)).find("poses.csv:42: column 'x' holds 1e7"),
            std::string::npos);
}

TEST_F(SightingFiles, QuaternionsThatAreAllScaledAreNormalised) {
  const ReadSightings<PoseTracks> read = read_poses_of(
      "t,body,x,y,z,qx,qy,qz,qw\n0,1,0,0,0,0,0,0,2\n1,1,0,0,0,0,0,2,0\n2,1,0,0,0,0,2,0,0\n");
  EXPECT_EQ(read.found.tracks[0].samples.size(), 3U);
  EXPECT_EQ(read.found.tracks[0].samples[0].T_camera_marker.rotation.w(), 1.0);
  ASSERT_EQ(read.warnings.size(), 1U);
  EXPECT_NE(read.warnings[0].find("3 of 3 quaternions are normalised"), std::string::npos);
}

TEST_F(SightingFiles, PositionsThatSpanAHallAreMillimetres) {
  const ReadSightings<PoseTracks> read = read_poses_of(forty_poses("41,1,0,0,0,0,0,0,1", 1e3));
  EXPECT_NEAR(read.found.tracks[0].samples[10].T_camera_marker.translation.x(), 0.1, 1e-12);
  ASSERT_EQ(read.warnings.size(), 1U);
  EXPECT_NE(read.warnings[0].find("they are taken as mm"), std::string::npos);
  EXPECT_TRUE(read_poses_of(forty_poses("41,1,5e5,0,0,0,0,0,1")).warnings.empty())
      << "one position far off changes no unit";
}

TEST_F(SightingFiles, PointsOfATrackerInMillimetresAreTakenSo) {
  folder_.write("points.csv",
                "t,point,x,y,z,sigma\n0,1,1500,0,20,0.02\n1,1,1800,0,20,\n2,1,2250,0,30,0.02\n");
  const ReadSightings<PointObservations> read = read_points(folder_.path() / "points.csv");
  ASSERT_EQ(read.found.observations.size(), 3U);
  EXPECT_NEAR(read.found.observations[0].position_m->x(), 1.5, 1e-12);
  EXPECT_NEAR(read.found.observations[0].sigma_m, 2e-5, 1e-12);
  EXPECT_NEAR(read.found.observations[1].sigma_m, 1e-4, 1e-12) << "the default is in m";
  ASSERT_EQ(read.warnings.size(), 1U);
  EXPECT_NE(read.warnings[0].find("span 750 m: they are taken as mm"), std::string::npos);
}

TEST_F(SightingFiles, PositionsThatSpanMoreThanACellAreAskedFor) {
  const ReadSightings<PoseTracks> read = read_poses_of(forty_poses("41,1,0,0,0,0,0,0,1", 1e2));
  EXPECT_NEAR(read.found.tracks[0].samples[10].T_camera_marker.translation.x(), 10.0, 1e-9);
  ASSERT_EQ(read.warnings.size(), 1U);
  EXPECT_NE(read.warnings[0].find("are they in another unit?"), std::string::npos);
  folder_.write("points.csv", "t,point,x,y,z\n0,1,0,0,0\n1,1,30,0,0\n2,1,48,0,0\n");
  EXPECT_EQ(read_points(folder_.path() / "points.csv").warnings.size(), 1U);
}

TEST_F(SightingFiles, UnitsInTheHeaderAreUsed) {
  const PoseTracks found =
      poses("t [ms],body,x [mm],y [mm],z [m],qx,qy,qz,qw\n500,1,10,20,3,0,0,0,1\n");
  EXPECT_EQ(found.times_s, std::vector<double>{0.5});
  EXPECT_LT(
      (found.tracks[0].samples[0].T_camera_marker.translation - Eigen::Vector3d(0.01, 0.02, 3.0))
          .norm(),
      1e-15);
}

std::string twenty_sightings(const std::map<int, std::string>& rows_of) {
  std::string text = "t,tag,corner,u,v\n";
  for (int i = 0; i < 20; ++i) {
    const auto other = rows_of.find(i);
    if (other != rows_of.end()) {
      text += other->second;
      continue;
    }
    for (int c = 0; c < 4; ++c) text += fmt::format("{},1,{},{},{}\n", i, c, c, c % 2);
  }
  return text;
}

TEST_F(SightingFiles, SightingsWithABadRowAreLeftOut) {
  const std::map<std::string, std::string> bad = {
      {"3,1,0,nan,0\n3,1,1,1,1\n3,1,2,2,0\n3,1,3,3,1\n",
       "14: column 'u' holds 'nan', not a finite number"},
      {"3,1,0,0,1e8\n3,1,1,1,1\n3,1,2,2,0\n3,1,3,3,1\n",
       "14: column 'v' holds 1e8, which is out of all reach"},
      {"3,1,0,0,0\n3,1,1,1,1\n3,1,2,2,0\n", "16: tag 1 at t = 3 has 3 corners of 4"}};
  for (const auto& [rows, complaint] : bad) {
    const TagObservations found = corners(twenty_sightings({{3, rows}}));
    EXPECT_EQ(found.observations.size(), 19U) << rows;
    EXPECT_EQ(found.times_s.size(), 20U) << rows;
    ASSERT_EQ(found.warnings.size(), 1U) << rows;
    EXPECT_TRUE(found.warnings[0].ends_with("corners.csv:" + complaint + ": left out"))
        << found.warnings[0];
  }
  EXPECT_EQ(corners(twenty_sightings({{19, "19,1,0,0,0\n19,1,1,1"}})).observations.size(), 19U)
      << "a file that is cut off";
  const std::string one = "3,1,0,0,0\n";
  EXPECT_NE(
      corners_refusal(
          twenty_sightings({{3, one}, {4, "4,1,0,0,0\n"}, {5, "5,1,0,0,0\n"}, {6, "6,1,0,0,0\n"}}))
          .find("corners of 4"),
      std::string::npos);
}

TEST_F(SightingFiles, PointsInTheTrackersFrameOrInATarget) {
  const PointObservations found =
      points("t,point,x,y,z,sigma,target\n0,1,1,2,3,0.002,\n1,1,,,,,left\n");
  ASSERT_EQ(found.observations.size(), 2U);
  EXPECT_EQ(*found.observations[0].position_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(found.observations[0].sigma_m, 0.002);
  EXPECT_FALSE(found.observations[1].position_m);
  EXPECT_EQ(found.observations[1].target, "left");
  EXPECT_EQ(found.observations[1].frame, 1);
}

TEST_F(SightingFiles, PointsRefused) {
  EXPECT_NE(points_refusal("t,point,x,y,z\n0,1,,,\n")
                .find("points.csv:2: has neither a position nor a target"),
            std::string::npos);
  EXPECT_NE(
      points_refusal("t,point,x,y,z\n0,1,1,,\n").find("points.csv:2: some of x, y, z are empty"),
      std::string::npos);
  EXPECT_NE(points_refusal("t,point,x,y,z\n0,1,1,2,3\n0,1,1,2,3\n").find("stands there twice"),
            std::string::npos);
}

}  // namespace
}  // namespace kinescope
