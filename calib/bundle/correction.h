// SPDX-License-Identifier: Apache-2.0
//
// What an effect changes in the prediction: one number times a known share in every frame.
#pragma once

#include <string>

#include <Eigen/Core>

#include "kinematics/core/pose.h"

namespace kinescope {

enum class CorrectedPart {
  kJoint,        ///< a twist (rad, m) behind the joint's motion, in the link's frame
  kMarker,       ///< a twist of the marker in its own frame
  kMarkerSize,   ///< the marker's size over the declared one, minus 1
  kMarkerWidth,  ///< the marker's width over its height, minus 1, the size kept
  kMarkerShear,  ///< rad by which the marker's right angles are off, its axes turned alike
  kMarkerWarp,   ///< m by which two opposite corners stand before the marker's plane, two behind it
  kCamera,       ///< a twist of everything seen, in the camera's frame
  kGrowth,       ///< distances from the base's origin of all that joints carry over those at first,
                 ///< minus 1
  kCarried,      ///< a shift of all that joints carry, along the base's axes
  kIntrinsic,    ///< a change of an intrinsic parameter (fx fy cx cy d1 ..)
  kFocalLength,  ///< fx and fy over the declared ones, minus 1
  kBloom,        ///< px by which the edges of all markers stand inside of where they are
  kReadout,      ///< s per image row by which a corner is seen later than the frame's middle row
  kClock         ///< s by which the log is further ahead than the time offset says
};

inline constexpr int kEverywhere = -1;

/// Of a correction that is in proportion to a joint's value: "joint3 scale error".
inline constexpr const char* kScaleError = "scale error";

/// A parameter of the bundle that is zero where the effect is absent.
struct Correction {
  std::string name;   ///< "joint3 backlash width"
  std::string block;  ///< "joint3", "tag_12", "camera", "clock"
  std::string unit;
  CorrectedPart part = CorrectedPart::kJoint;
  /// Of the joint or the marker in the tree, or of the intrinsic parameter; kEverywhere: the sizes
  /// of all markers, the readings of all joints.
  int index = 0;
  /// Twists: rotation, then translation; of shifts the latter counts.
  Vector6d direction = Vector6d::Zero();
  Eigen::VectorXd share;  ///< frames; empty: 1 everywhere
  /// Frames x 6: the twist itself, where its direction changes from frame to frame; takes the place
  /// of direction and share.
  Eigen::Matrix<double, Eigen::Dynamic, 6> twists;
  double value = 0.0;  ///< where the search starts
  /// What the shares were divided by (the largest load's arm, m); 1 where they were not.
  double reference = 1.0;
  /// What nobody asks for and yet has to be known beside an effect: where in its gap a joint began.
  bool is_nuisance = false;
  bool is_local = false;  ///< bears on a few neighbouring frames
  /// Standard deviation of a Gaussian prior about zero, in the unit of the value and beside rows
  /// that are whitened; 0: none.
  double prior_sigma = 0.0;
};

}  // namespace kinescope
