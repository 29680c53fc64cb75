// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/unexplained.h"

#include <algorithm>
#include <cmath>

#include "kinematics/structure/attachment_cost.h"

namespace kinescope::structure_search {
namespace {

// Variance over the declared one up to which a residual may be noise: declarations are often wrong
// by a factor, and small motions are then mostly noise.
constexpr double kNoise = 9.0;

}  // namespace

Unexplained unexplained_motion(const Attachment& attachment) {
  const ChainFit& fit = attachment.fit;
  const double size = std::pow(attachment.motion_size, 2);
  if (attachment.at_rest() || !(size > 0.0)) return {};
  constexpr double kPoseSize = 6.0;
  const double axes = fit.model.joints.size() == 1 ? 1.0 : 0.0;
  const double across = (kPoseSize - axes) * std::max(0.0, fit.variance - kNoise);
  const double along = axes * std::max(0.0, fit.axis_variance - kNoise);
  const double beyond_noise = across + along;
  if (!(beyond_noise > 0.0)) return {};
  const double whole = (kPoseSize - axes) * fit.variance + axes * fit.axis_variance;
  const double left = std::pow(fit.translation_rms, 2) + std::pow(kLever * fit.rotation_rms, 2);
  const double share = std::min(1.0, left / size * beyond_noise / whole);
  return {.across = share * across / beyond_noise, .along = share * along / beyond_noise};
}

}  // namespace kinescope::structure_search
