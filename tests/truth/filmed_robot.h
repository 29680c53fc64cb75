// SPDX-License-Identifier: Apache-2.0
//
// Robots of the kinds that people have, with a tag on every link, before a camera, and a smooth
// motion that covers their ranges and turns back often. Exact: no effect, no noise
// (camera_effects.h films them). The same seed gives the same robot and motion.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "kinematics/core/rng.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope::truth {

enum class RobotKind {
  kArm3,    ///< three revolute joints, axes at random
  kArm6,    ///< six
  kScara,   ///< R R P R, axes nearly parallel
  kGantry,  ///< P P P at right angles and a wrist
  kTree,    ///< a trunk with two branches, five joints
  kArm7,    ///< seven
  kPlanar,  ///< four revolute joints, axes nearly parallel
  kWrist    ///< R R R and a wrist of two slides
};
/// Those of the figures that others are compared with.
inline constexpr std::array<RobotKind, 5> kRobotKinds{
    RobotKind::kArm3, RobotKind::kArm6, RobotKind::kScara, RobotKind::kGantry, RobotKind::kTree};
inline constexpr std::array<RobotKind, 8> kAllRobotKinds{
    RobotKind::kArm3, RobotKind::kArm6, RobotKind::kScara,  RobotKind::kGantry,
    RobotKind::kTree, RobotKind::kArm7, RobotKind::kPlanar, RobotKind::kWrist};
[[nodiscard]] std::string_view to_string(RobotKind kind);

struct FilmedRobotOptions {
  std::uint64_t seed = 1;
  RobotKind kind = RobotKind::kArm3;
  double duration_s = 33.0;
  double amplitude_rad = 1.0;         ///< every joint reaches this or its negative
  double prismatic_m_per_rad = 0.12;  ///< prismatic joints move this far where others turn by 1 rad
  double lowest_hz = 0.1;             ///< of the three sines of every joint
  double highest_hz = 0.4;
  double rest_s = 0.0;  ///< at the beginning and the end; a second of starting and stopping between
  double tag_size_m = 0.05;
  double scale = 1.0;                                ///< of the links' lengths and the slides' ways
  double distance_m = 1.3;                           ///< of the camera from the middle of the robot
  Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();  ///< gravity, base frame
};

/// Three sines, begun and ended at rest where that is asked for.
class SmoothMotion {
 public:
  /// Peak `reach` between 0 and `duration_s`.
  SmoothMotion(double reach, const FilmedRobotOptions& options, Rng& rng);
  [[nodiscard]] double value(double t_s) const;
  [[nodiscard]] double rate(double t_s) const;  ///< per s

 private:
  struct Sine {
    double amplitude = 0.0;
    double omega = 0.0;  ///< rad/s
    double phase = 0.0;
  };
  // Time along the motion, and how fast it goes.
  [[nodiscard]] double phase_s(double t_s) const;
  [[nodiscard]] double pace(double t_s) const;

  std::array<Sine, 3> sines_;
  double rest_s_ = 0.0;
  double duration_s_ = 0.0;
};

/// 0, step, .. up to the duration.
[[nodiscard]] std::vector<double> instants(double duration_s, double step_s);

struct FilmedRobot {
  KinematicTree tree;  ///< joint k: "q<k+1>", its child link k + 1, its tag id k + 11; base tag 10
  Pose T_camera_base;  ///< base z points up in the image and towards the camera
  CameraModel camera;
  MarkerSet markers;
  std::vector<SmoothMotion> motions;  ///< of every joint's encoder, on the joint log's clock
  double duration_s = 0.0;
  double last_frame_s = 0.0;
  double rest_s = 0.0;  ///< at the beginning and the end
  double prismatic_m_per_rad = 0.0;
  std::uint64_t seed = 0;
  Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();  ///< gravity, unit, base frame

  [[nodiscard]] Eigen::VectorXd encoders(double t_s) const;
};

[[nodiscard]] FilmedRobot draw_filmed_robot(const FilmedRobotOptions& options);

}  // namespace kinescope::truth
