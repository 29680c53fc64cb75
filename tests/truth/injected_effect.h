// SPDX-License-Identifier: Apache-2.0
//
// What a recording can have in it that nobody declares. Signs: true joint value = value that the
// log gives by the nominal model + the effect. Joints are named as in the tree ("q2"), tags
// "tag_12"; the rest sits on "camera" or "clock". What is random in an effect (a phase, a
// direction) follows from the world's seed, the effect's name and its place.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tests/truth/filmed_robot.h"

namespace kinescope::truth {

/// `effect`, its `size` and `detail`:
///   time_offset      s, joint-log time = frame time + size; on a joint: of its reading alone
///   clock_drift      s/s, the log's clock gains this; detail: share of the way from the first
///                    frame to the last at which the clocks agree
///   encoder_scale    1, true = (1 + size) x logged
///   eccentricity     rad amplitude; detail 1: an encoder disc out of centre, 2: a universal joint
///   gear_error       rad (m) amplitude, sine; detail: periods a turn (a metre), any number
///   backlash         rad (m), width of the gap
///   compliance       rad (m), largest sag under gravity of the links' own masses and payloads
///   coupling         true value of `place` += size x logged value of `with`
///   helical          m the joint advances along its axis in one turn
///   curved_slider    1/m, the slide runs on a circle of this curvature, the carriage along the
///                    tangent
///   axis_wobble      rad, cone that the shaft's axis describes; detail: turns of its tilt while
///                    the joint turns once, seen from the frame (0 and 1 would be a tilted bearing,
///                    a bent shaft: no wobble but another geometry)
///   lens_distortion  1, change of k1; detail: of k2. `with` "tangential": of p1 and p2
///   intrinsics       1, change of the focal length; `with` "centre": px, of the image's centre,
///                    somewhere
///   bent_tag         m, the tag lies on a cylinder: two opposite corners that far before the
///                    plane, two behind; detail: rad, of the cylinder's axis from the tag's x
///   quantisation     rad (m), the joint's reading is rounded to a multiple of that
///   rolling_shutter  s a row; detail: row exposed at the frame's stamp, share of the height
///   blooming         px, white shines into black: all edges move towards the tag's centre
///   tag_size         1, the tag (on "tags": every one) is (1 + size) x as large as declared
///   tag_slip         m, in the tag's plane, with a small turn; detail: when, share of the time
///   camera_bump      rad, about a point 0.3 m away; detail: when, share of the time
///   camera_drift     rad from the first frame to the last, about a point 0.3 m away; detail: time
///                    constant of its approach to rest, share of the time
///   focal_jump       1, change of the focal length from then on; detail: when, share of the time
///   focal_drift      1, change of the focal length from the first frame to the last; detail as of
///                    camera_drift
///   thermal_growth   1, growth of all the robot's lengths from the first frame to the last; detail
///                    as of camera_drift
///   zero_jump        rad (m), the joint's zero from then on; detail: when, share of the time
///   zero_drift       rad (m) from the first frame to the last; detail as of camera_drift
///   clock_jump       s, joint-log time = frame time + size from then on; detail: when, share of
///                    the time
/// and of the test's own making, in no library:
///   own_tanh         true value of `place` +=
///                    size x tanh(5 (logged value of `with` - detail) / reach)
///   own_cubic        true value of `place` += size x (its value / reach)^3; not drawn at random
///   own_speed        true value of `place` += size x (speed of `with` / its largest)^2
///   own_chequer      px, corners shift one way on the black fields of a chequered image and back
///                    on the white ones; detail: px, edge of a field
///   own_ripple       px, corners shift along a wave over the image; detail: px, its length
///   own_product      true value of `place` +=
///                    size x (its value / reach) x (value of `with` / reach)
///   own_acceleration true value of `place` += size x acceleration of `with` / its largest
///   own_vibration    rad (m) amplitude; detail: Hz
///   own_sway         rad, amplitude of the camera's turn; detail: Hz; not drawn at random
///   own_hunting      1, amplitude of the focal length's swing; detail: Hz
///   own_creep        true value of `place` += size x (value of `with`, as it was about 1.5 s ago
///                    and before, fading - its value) / reach
struct InjectedEffect {
  std::string effect;
  std::string place;
  double size = 0.0;
  double detail = 0.0;
  std::string with = {};  ///< the other joint, or a variant
};

/// The names of the library of effects, and those of the test's own making.
[[nodiscard]] const std::vector<std::string>& library_effects();
[[nodiscard]] const std::vector<std::string>& own_effects();

/// The place under which the library has the effect: variants of a camera's have one each, "camera
/// tangential".
[[nodiscard]] std::string place_in_library(const InjectedEffect& effect);

/// True for effects that sit on a joint; the others sit on a tag, the camera or the clock.
[[nodiscard]] bool sits_on_joint(std::string_view effect);
/// A time_offset that is not the clock's.
[[nodiscard]] bool is_late_joint(const InjectedEffect& effect);
/// Of the robot's own mechanics: of joints, late readings; not of what the log makes of
/// it.
[[nodiscard]] bool is_mechanical(const InjectedEffect& effect);
/// Share, 0 at 0 and 1 at the end, of what creeps towards rest with a time constant.
[[nodiscard]] double creep(double t_s, double time_constant_s, double last_s);
/// False where an effect makes no sense: a slide has no screw, a hinge no curvature.
[[nodiscard]] bool can_have(JointType type, std::string_view effect);

/// The unit of an effect's size on a joint of this type.
[[nodiscard]] std::string_view size_unit(std::string_view effect, JointType type);

/// An effect at the smallest strength that tracing is asked to see (figures for 33 s at 30 Hz,
/// corners of 0.1 px), at every place of the robot where it can sit and where it shows:
///   lag 0.5 ms, scale 500 ppm, eccentricity 0.03 deg, backlash 0.05 deg, sag 0.03 deg, coupling
///   0.002, screw 0.05 mm a turn, k1 0.002, line 1 us, slip 0.3 mm, bump 0.3 px; others as visible.
/// On prismatic joints angles become lengths by the world's m per rad.
[[nodiscard]] std::vector<InjectedEffect> weakest_effects(std::string_view effect,
                                                          const FilmedRobot& robot);

}  // namespace kinescope::truth
