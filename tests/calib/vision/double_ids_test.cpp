// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/double_ids.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "calib/vision/sightings.h"

namespace kinescope {
namespace {

constexpr int kFrames = 120;
constexpr double kEdge = 30.0;  // px

using Place = std::function<Eigen::Vector2d(double)>;
using Seen = std::function<bool(int)>;

bool always(int /*frame*/) { return true; }

struct DoubledSightings {
  TagObservations all;
  double rate_hz = 30.0;

  DoubledSightings() {
    for (int f = 0; f < kFrames; ++f) all.times_s.push_back(f / rate_hz);
  }
  DoubledSightings& add(const Place& place, const Seen& seen = always, double margin = 80.0,
                        int id = 265) {
    for (int f = 0; f < kFrames; ++f) {
      if (!seen(f)) continue;
      TagObservation tag;
      tag.frame = f;
      tag.id = TagId{id};
      tag.decision_margin = margin;
      const Eigen::Vector2d at = place(all.times_s[static_cast<std::size_t>(f)]);
      for (const Eigen::Vector2d& corner :
           {Eigen::Vector2d{0, kEdge}, {kEdge, kEdge}, {kEdge, 0}, {0, 0}}) {
        tag.corners_px.push_back(at + corner);
      }
      all.observations.push_back(tag);
    }
    return *this;
  }
  std::vector<std::string> sort_out() {
    MarkerSet markers;
    markers.default_size_m = 0.05;
    return sort_out_sightings(all, markers, 5);
  }
  /// Sightings left that are where `place` says.
  [[nodiscard]] std::size_t left_at(const Place& place) const {
    std::size_t count = 0;
    for (const TagObservation& tag : all.observations) {
      const Eigen::Vector2d at = place(all.times_s[static_cast<std::size_t>(tag.frame)]);
      if ((tag.corners_px[3] - at).norm() < 1.0) ++count;
    }
    return count;
  }
};

Eigen::Vector2d robot(double t) {
  return {400.0 + 150.0 * std::sin(2.0 * t), 200.0 + 90.0 * std::sin(3.1 * t)};
}
Eigen::Vector2d sheet(double /*t*/) { return {900.0, 600.0}; }
Eigen::Vector2d other_sheet(double /*t*/) { return {80.0, 600.0}; }

const char* const kMovingTaken =
    "two markers with id 265 are in view: remove one (the one that moves is taken for the "
    "robot's)";
const char* const kNoneTaken =
    "two markers with id 265 are in view: remove one (neither is used, as it is not clear which "
    "one is the robot's)";

TEST(DoubleIds, OneAtRestAndOneThatMoves) {
  DoubledSightings scene;
  scene.add(robot).add(sheet);
  EXPECT_EQ(scene.sort_out(), std::vector<std::string>{kMovingTaken});
  EXPECT_EQ(scene.left_at(robot), static_cast<std::size_t>(kFrames));
  EXPECT_EQ(scene.all.observations.size(), static_cast<std::size_t>(kFrames));
  EXPECT_EQ(scene.all.rejected.size(), static_cast<std::size_t>(kFrames));
}

TEST(DoubleIds, OfTheMovingOneAlsoStretchesInWhichTheOtherIsHidden) {
  // The robot's marker is lost now and then, and the spare one for good.
  const Seen robot_seen = [](int f) { return f % 40 < 25; };
  DoubledSightings scene;
  scene.add(robot, robot_seen).add(sheet, [](int f) { return f < 60; });
  EXPECT_EQ(scene.sort_out(), std::vector<std::string>{kMovingTaken});
  EXPECT_EQ(scene.left_at(robot), 75U);
  EXPECT_EQ(scene.left_at(sheet), 0U);
}

TEST(DoubleIds, SeenInTurns) {
  // Never in the same frame: what follows in windows often sees one of them only.
  DoubledSightings scene;
  scene.add(robot, [](int f) { return f % 2 == 0; });
  scene.add(sheet, [](int f) { return f % 2 == 1; });
  EXPECT_EQ(scene.sort_out(), std::vector<std::string>{kMovingTaken});
  EXPECT_EQ(scene.left_at(robot), 60U);
  EXPECT_EQ(scene.left_at(sheet), 0U);
}

TEST(DoubleIds, ARobotThatRestsBetweenMoves) {
  const Place stops = [](double t) { return robot(t < 1.5 ? 0.0 : std::min(t - 1.5, 1.0)); };
  DoubledSightings scene;
  // Hidden before it moves, so that its rest is a tracklet of its own.
  scene.add(stops, [](int f) { return f < 25 || f > 55; }).add(sheet);
  EXPECT_EQ(scene.sort_out(), std::vector<std::string>{kMovingTaken});
  EXPECT_EQ(scene.left_at(stops), 89U);
  EXPECT_EQ(scene.left_at(sheet), 0U);
}

TEST(DoubleIds, PosturesOneByOne) {
  DoubledSightings scene;
  for (double& t : scene.all.times_s) t *= 60.0;  // 2 s apart
  scene.add([](double t) { return Eigen::Vector2d{robot(37.0 * t)}; }).add(sheet);
  EXPECT_EQ(scene.sort_out(), std::vector<std::string>{kMovingTaken});
  EXPECT_EQ(scene.left_at(sheet), 0U);
  EXPECT_EQ(scene.all.observations.size(), static_cast<std::size_t>(kFrames));
}

TEST(DoubleIds, TwoThatMoveOrTwoAtRestAreLeftOut) {
  const Place second = [](double t) { return Eigen::Vector2d{robot(t + 3.0) + sheet(t)}; };
  for (const auto& [a, b] : {std::pair<Place, Place>{robot, second}, {sheet, other_sheet}}) {
    DoubledSightings scene;
    scene.add(a).add(b).add(robot, always, 80.0, 7);
    EXPECT_EQ(scene.sort_out(), std::vector<std::string>{kNoneTaken});
    EXPECT_EQ(scene.all.observations.size(), static_cast<std::size_t>(kFrames));
    for (const TagObservation& tag : scene.all.observations) EXPECT_EQ(tag.id.value, 7);
  }
}

TEST(DoubleIds, OneMarkerIsOne) {
  // At home, hidden, elsewhere, hidden, and at home again.
  const Place there_and_back = [](double t) {
    return t < 1.0 || t > 3.0 ? robot(0.0) : robot(std::abs(t - 2.0));
  };
  DoubledSightings scene;
  scene.add(there_and_back, [](int f) { return f % 30 < 24; });
  EXPECT_TRUE(scene.sort_out().empty());
  // A shadow that is taken for the marker now and then.
  DoubledSightings ghosts;
  ghosts.add(robot).add(sheet, [](int f) { return f % 12 == 0; }, 20.0);
  for (const std::string& warning : ghosts.sort_out()) {
    EXPECT_EQ(warning.find(kTwoMarkers), std::string::npos) << warning;
  }
  EXPECT_EQ(ghosts.left_at(robot), static_cast<std::size_t>(kFrames));
  // A base marker beside a pattern on the robot that is taken for it.
  DoubledSightings base;
  base.add(sheet).add(robot, [](int f) { return f > 100; }, 20.0);
  for (const std::string& warning : base.sort_out()) {
    EXPECT_EQ(warning.find(kTwoMarkers), std::string::npos) << warning;
  }
  EXPECT_EQ(base.left_at(sheet), static_cast<std::size_t>(kFrames));
  // Stops reached from one frame to the next.
  DoubledSightings stops;
  stops.add([](double t) { return robot(10.0 * std::floor(2.0 * t)); });
  EXPECT_TRUE(stops.sort_out().empty());
}

}  // namespace
}  // namespace kinescope
