// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/unexplained.h"

#include <gtest/gtest.h>

namespace kinescope::structure_search {
namespace {

Attachment hinge(double variance, double axis_variance, double left_m) {
  Attachment a;
  a.fit.model.joints.resize(1);
  a.fit.variance = variance;
  a.fit.axis_variance = axis_variance;
  a.fit.translation_rms = left_m;
  a.motion_size = 0.1;
  return a;
}

TEST(UnexplainedMotion, NoiseIsNone) {
  EXPECT_EQ(unexplained_motion(hinge(1.0, 1.0, 0.08)).all(), 0.0) << "a motion as small as noise";
  EXPECT_EQ(unexplained_motion(hinge(4.0, 4.0, 0.08)).all(), 0.0) << "a noise declared too small";
}

TEST(UnexplainedMotion, IsAShareOfTheMotionNotOfTheNoise) {
  const Unexplained eccentric = unexplained_motion(hinge(1.0, 900.0, 0.002));
  EXPECT_NEAR(eccentric.all(), 4e-4, 1e-5);
  EXPECT_EQ(eccentric.across, 0.0);
  const Unexplained wrong = unexplained_motion(hinge(900.0, 1.0, 0.04));
  EXPECT_NEAR(wrong.across, 0.16, 0.01);
  EXPECT_EQ(wrong.along, 0.0);
  EXPECT_EQ(unexplained_motion(hinge(900.0, 900.0, 0.3)).all(), 1.0) << "no more than all of it";
}

}  // namespace
}  // namespace kinescope::structure_search
