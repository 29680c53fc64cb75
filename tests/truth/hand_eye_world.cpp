// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/hand_eye_world.h"

#include <cmath>
#include <numbers>

#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope::truth {
namespace {

constexpr int kWidth = 2560;  // px: wide enough for every pose
constexpr int kHeight = 1920;

// The hand points down; so it sees a table before the base.
const Eigen::Vector3d kHome(0.5, 0.0, 0.45);

Pose pointing_down() { return {exp_rotation({std::numbers::pi, 0.0, 0.0}), kHome}; }

Pose jittered(Rng& rng, const Pose& pose, double rad, double m) {
  Vector6d d;
  d << rng.normal3(rad), rng.normal3(m);
  return pose * exp_pose(d);
}

class Maker {
 public:
  explicit Maker(const HandEyeWorldOptions& options)
      : o_(options), rng_(Rng::from_name("hand eye world", options.seed)) {}

  HandEyeWorld world() {
    place();
    if (o_.motion) {
      move();
    } else {
      stand();
    }
    finish();
    return std::move(out_);
  }

 private:
  [[nodiscard]] bool on_hand() const { return o_.mount == CameraMount::kOnHand; }

  // Camera and targets face each other with the hand at home.
  void place() {
    const Pose F = pointing_down();
    const Pose T_flange_camera =
        jittered(rng_, {Eigen::Quaterniond::Identity(), {0.06, -0.03, 0.08}}, 0.2, 0.01);
    for (int k = 0; k < o_.targets; ++k) {
      const Eigen::Vector3d beside(0.12 * k, 0.03 * k, 0.0);
      const Pose T_base_target =
          jittered(rng_, {F.rotation, {0.5 + beside.x(), beside.y(), 0.02}}, 0.15, 0.01);
      const Pose T_flange_target = jittered(
          rng_, {Eigen::Quaterniond::Identity(), {0.05 + beside.x(), beside.y(), 0.1}}, 0.15, 0.01);
      out_.targets.push_back(on_hand() ? T_base_target : T_flange_target);
    }
    if (on_hand()) {
      out_.camera = T_flange_camera;
      return;
    }
    // From below, 0.6 m before the hand, looking up; the targets' z points away from it.
    const Pose T_base_camera{exp_rotation({0.0, 0.0, 0.3}), kHome - Eigen::Vector3d(0, 0, 0.6)};
    out_.camera = jittered(rng_, T_base_camera, 0.1, 0.02);
    for (Pose& target : out_.targets)
      target.rotation = exp_rotation({std::numbers::pi, 0.0, 0.0}) * target.rotation;
  }

  Pose flange(const Eigen::Vector3d& turn, const Eigen::Vector3d& shift) {
    const Pose home = pointing_down();
    return {home.rotation * exp_rotation(turn), home.translation + shift};
  }

  Eigen::Vector3d turn_of(const Eigen::Vector3d& share) const {
    return o_.one_axis ? Eigen::Vector3d(0.0, 0.0, o_.turn_rad * share.z())
                       : Eigen::Vector3d(o_.turn_rad * share);
  }

  Eigen::Vector3d uniform3() {
    return {rng_.uniform(-1.0, 1.0), rng_.uniform(-1.0, 1.0), rng_.uniform(-1.0, 1.0)};
  }

  // The target stays near the middle of the view: the hand goes where it turns away from.
  void stand() {
    for (int i = 0; i < o_.poses; ++i) {
      const Eigen::Vector3d turn = turn_of(uniform3());
      const Eigen::Vector3d shift = 0.06 * uniform3() + 0.3 * leaning(turn);
      const Pose F = flange(turn, shift);
      const auto t = static_cast<double>(i);
      look(i, t, F);
      log(t, F, i == o_.wrong_row);
    }
    log_.numbered = true;
    log_.time_column = "row";
  }

  Eigen::Vector3d leaning(const Eigen::Vector3d& turn) const {
    return on_hand() ? Eigen::Vector3d(-turn.y(), -turn.x(), 0.0) : Eigen::Vector3d::Zero();
  }

  Pose at(double t) {
    const auto wave = [&](double hz, double phase) {
      return std::sin(2.0 * std::numbers::pi * hz * t + phase);
    };
    const Eigen::Vector3d turn = turn_of({wave(0.11, 0.3), wave(0.17, 1.1), wave(0.07, 2.0)});
    const Eigen::Vector3d shift =
        0.06 * Eigen::Vector3d(wave(0.13, 0.5), wave(0.19, 1.7), wave(0.09, 0.1));
    return flange(turn, shift + 0.3 * leaning(turn));
  }

  void move() {
    constexpr double kFrames = 30.0;
    constexpr double kRows = 100.0;
    constexpr double kMargin = 1.0;  // of the log before and behind the frames, s
    const double length = static_cast<double>(o_.poses) / kFrames;
    const double middle = 0.5 * static_cast<double>(o_.poses - 1) / kFrames;
    for (int k = 0; k < static_cast<int>((length + 2.0 * kMargin) * kRows); ++k) {
      const double t = k / kRows - kMargin;
      log(t + o_.lag_s + o_.drift * (t - middle), at(t), false);
    }
    for (int i = 0; i < o_.poses; ++i) look(i, i / kFrames, at(i / kFrames));
  }

  void log(double t, const Pose& F, bool wrong) {
    Pose read = jittered(rng_, F, o_.flange_sigma_rad, o_.flange_sigma_m);
    read.translation *= 1.0 - o_.scale;
    if (wrong) read.translation += Eigen::Vector3d(0.0, 0.02, 0.0);
    log_.times_s.push_back(t);
    log_.poses.push_back(o_.direction == PoseDirection::kBaseFlange ? read : read.inverse());
  }

  void look(int frame, double t, const Pose& F) {
    Pose camera = out_.camera;
    if (2 * frame >= o_.poses) camera.translation += Eigen::Vector3d(o_.bump_m, 0.0, 0.0);
    out_.input.measurements.times_s.push_back(t);
    for (std::size_t k = 0; k < out_.targets.size(); ++k) {
      const Pose B = on_hand() ? F.inverse() : F;
      const Pose T = camera.inverse() * B * out_.targets[k];
      const TagId id{static_cast<int>(k)};
      if (o_.corners) {
        see_corners(frame, id, T);
      } else {
        see_pose(frame, k, T);
      }
    }
  }

  void see_corners(int frame, TagId id, const Pose& T) {
    TagObservation seen;
    seen.frame = frame;
    seen.id = id;
    seen.sigma_px = std::max(o_.sigma_px, 0.05);
    for (const Eigen::Vector3d& corner : square_corners(o_.target_size_m)) {
      const auto pixel = project(camera(), T * corner);
      KINESCOPE_CHECK(pixel.has_value(), "the target is before the camera");
      seen.corners_px.emplace_back(pixel->x() + rng_.normal(o_.sigma_px),
                                   pixel->y() + rng_.normal(o_.sigma_px));
    }
    out_.input.measurements.corners.push_back(std::move(seen));
  }

  void see_pose(int frame, std::size_t k, const Pose& T) {
    PoseSample sample;
    sample.frame = frame;
    sample.T_camera_marker = jittered(rng_, T, o_.pose_sigma_rad, o_.pose_sigma_m);
    Vector6d variances;
    variances << Eigen::Vector3d::Constant(4e-6), Eigen::Vector3d::Constant(1e-6);
    sample.covariance = variances.asDiagonal();
    auto& tracks = out_.input.measurements.poses.tracks;
    if (tracks.size() <= k) tracks.push_back({TagId{static_cast<int>(k)}, {}});
    tracks[k].samples.push_back(std::move(sample));
  }

  static CameraModel camera() {
    CameraModel out = pinhole_guess(kWidth, kHeight, 1000.0);
    out.distortion[0] = -0.05;
    return out;
  }

  void finish() {
    HandEyeInput& input = out_.input;
    input.camera = camera();
    input.markers.default_size_m = o_.target_size_m;
    input.measurements.poses.times_s = input.measurements.times_s;
    log_.source = "flange.csv";
    input.readings.push_back({"quaternion", std::move(log_)});
    if (!o_.corners) {
      input.tracks = input.measurements.poses;
      return;
    }
    const TagObservations tags{.times_s = input.measurements.times_s,
                               .width = kWidth,
                               .height = kHeight,
                               .observations = input.measurements.corners,
                               .rejected = {}};
    input.tracks = pose_tracks_from_tags(tags, input.camera, input.markers);
  }

  HandEyeWorldOptions o_;
  Rng rng_;
  HandEyeWorld out_;
  PoseLog log_;
};

}  // namespace

HandEyeWorld make_hand_eye_world(const HandEyeWorldOptions& options) {
  return Maker(options).world();
}

}  // namespace kinescope::truth
