// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/camera_effects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "tests/truth/mechanics.h"

namespace kinescope::truth {
namespace {

constexpr double kBumpLever = 0.3;    // m, from the camera to the point it turns about
constexpr double kFromBehind = 0.25;  // cosine of the view beyond which no tag is found
constexpr double kLogMargin = 0.5;    // s, that the log begins before and ends after the frames
constexpr double kTwoPi = 2.0 * std::numbers::pi;

// The clock of the log at an instant of the camera's.
struct Clock {
  double offset_s = 0.0;
  double drift = 0.0;
  double agree_s = 0.0;
  double jump_s = 0.0;
  double jumps_at_s = 0.0;
  [[nodiscard]] double log_time(double t_s) const {
    return t_s + offset_s + drift * (t_s - agree_s) + (t_s >= jumps_at_s ? jump_s : 0.0);
  }
};

struct Bump {
  double time_s = 0.0;
  Pose T_new_old;
};

struct Slip {
  double time_s = 0.0;
  Pose T_before_after;
};

struct Sway {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< rad, amplitude
  double omega = 1.0;                                  ///< rad/s
  [[nodiscard]] Pose at(double t_s) const {
    Pose T;
    T.rotation = exp_rotation(rotation * std::sin(omega * t_s));
    return T;
  }
};

// Creeps towards another place.
struct Drift {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< rad, at the last frame
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  double time_constant_s = 1.0;
  double last_s = 1.0;  // of the frames
  [[nodiscard]] Pose at(double t_s) const {
    Pose T;
    T.rotation = exp_rotation(rotation * creep(t_s, time_constant_s, last_s));
    T.translation = pivot - T.rotation * pivot;
    return T;
  }
};

// The focal length over the declared one.
struct Focus {
  double jump = 0.0;
  double jumps_at_s = 0.0;
  double drift = 0.0;  ///< at the last frame
  double time_constant_s = 1.0;
  double last_s = 1.0;  // of the frames
  double swing = 0.0;
  double omega = 1.0;  ///< rad/s
  [[nodiscard]] double factor(double t_s) const {
    return 1.0 + (t_s >= jumps_at_s ? jump : 0.0) + drift * creep(t_s, time_constant_s, last_s) +
           swing * std::sin(omega * t_s);
  }
};

struct Growth {
  double relative = 0.0;  ///< at the last frame
  double time_constant_s = 1.0;
  double last_s = 1.0;  // of the frames
  [[nodiscard]] double factor(double t_s) const {
    return 1.0 + relative * creep(t_s, time_constant_s, last_s);
  }
};

struct Ripple {
  Eigen::Vector2d per_px = Eigen::Vector2d::Zero();  ///< rad, across the wave
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
};

struct Bend {
  double curvature = 0.0;  ///< 1/m
  double axis_rad = 0.0;   ///< of the cylinder, from the tag's x

  [[nodiscard]] Eigen::Vector3d corner_m(const Eigen::Vector3d& flat_m) const {
    const Eigen::AngleAxisd to_cylinder(-axis_rad, Eigen::Vector3d::UnitZ());
    Eigen::Vector3d p = to_cylinder * flat_m;
    const double angle = p.y() * curvature;
    p.z() = (1.0 - std::cos(angle)) / curvature;
    p.y() = std::sin(angle) / curvature;
    return to_cylinder.inverse() * p;
  }
};

struct Chequer {
  double field_px = 1.0;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
};

// What the camera, the clock and the tags do that nobody declares.
struct Undeclared {
  Clock clock;
  CameraModel camera;
  Focus focus;
  double line_s = 0.0;  ///< a row
  double reference_row = 0.0;
  std::optional<Bump> bump;
  std::optional<Drift> drift;
  std::optional<Sway> sway;
  Growth growth;
  std::optional<Chequer> chequer;
  std::optional<Ripple> ripple;
  double bloom_px = 0.0;
  std::map<TagId, double> size_factor;
  std::map<TagId, Bend> bends;
  std::map<TagId, Slip> slips;
};

TagId tag_named(const FilmedRobot& robot, const std::string& place) {
  const auto named = [&place](const Marker& marker) {
    return fmt::format("tag_{}", marker.id.value) == place;
  };
  const auto found = std::ranges::find_if(robot.tree.markers, named);
  KINESCOPE_CHECK(found != robot.tree.markers.end(), "an effect sits on a tag of the robot");
  return found->id;
}

// Across the line of sight more than about it: a roll moves only the corners of the image.
Eigen::Vector3d axis_across(Rng& rng) {
  const double direction = rng.uniform(0.0, kTwoPi);
  return Eigen::Vector3d(std::cos(direction), std::sin(direction), rng.normal(0.3)).normalized();
}

Bump bump_of(const InjectedEffect& effect, double time_s, Rng& rng) {
  const Eigen::Vector3d axis = axis_across(rng);
  const Eigen::Vector3d pivot = rng.unit3() * kBumpLever;
  Pose T;
  T.rotation = exp_rotation(axis * effect.size);
  T.translation = pivot - T.rotation * pivot;
  return {time_s, T};
}

Drift drift_of(const InjectedEffect& effect, double time_constant_s, double last_s, Rng& rng) {
  const Eigen::Vector3d axis = axis_across(rng);
  return {axis * effect.size, rng.unit3() * kBumpLever, time_constant_s, last_s};
}

Sway sway_of(const InjectedEffect& effect, Rng& rng) {
  const Eigen::Vector3d axis = axis_across(rng);
  return {axis * effect.size, kTwoPi * effect.detail};
}

Ripple ripple_of(const InjectedEffect& effect, Rng& rng) {
  const auto towards = [&rng] {
    const double direction = rng.uniform(0.0, kTwoPi);
    return Eigen::Vector2d(std::cos(direction), std::sin(direction));
  };
  const Eigen::Vector2d per_px = towards() * (kTwoPi / effect.detail);
  return {per_px, towards() * effect.size};
}

Slip slip_of(const InjectedEffect& effect, double tag_size_m, double time_s, Rng& rng) {
  const double direction = rng.uniform(0.0, kTwoPi);
  const double turn = rng.uniform(-0.5, 0.5) * effect.size / tag_size_m;
  Pose T;
  T.rotation = exp_rotation({0.0, 0.0, turn});
  T.translation = effect.size * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0.0);
  return {time_s, T};
}

// Squares of two corners' distances from the cylinder's axis differ by size^2 sin(2 axis) / 2, and
// each stands before the plane by half the curvature times its own.
Bend bend_of(const InjectedEffect& effect, double tag_size_m) {
  const double difference = tag_size_m * tag_size_m * std::sin(2.0 * effect.detail);
  return {8.0 * effect.size / difference, effect.detail};
}

void add_intrinsics(const InjectedEffect& effect, Rng& rng, CameraModel& camera) {
  if (effect.with != "centre") {
    camera.fx *= 1.0 + effect.size;
    camera.fy *= 1.0 + effect.size;
    return;
  }
  const double direction = rng.uniform(0.0, kTwoPi);
  camera.cx += effect.size * std::cos(direction);
  camera.cy += effect.size * std::sin(direction);
}

void add_lens(const InjectedEffect& effect, CameraModel& camera) {
  const std::size_t first = effect.with == "tangential" ? 2 : 0;
  camera.distortion[first] += effect.size;
  camera.distortion[first + 1] += effect.detail;
}

void add(const InjectedEffect& effect, const FilmedRobot& robot, Undeclared& out) {
  Rng rng = Rng::from_name(fmt::format("injected {} {}", effect.effect, effect.place), robot.seed);
  const double time_s = effect.detail * robot.duration_s;
  if (effect.effect == "time_offset" && effect.place == "clock") {
    out.clock.offset_s += effect.size;
  } else if (effect.effect == "clock_drift") {
    out.clock.drift = effect.size;
    out.clock.agree_s = effect.detail * robot.last_frame_s;
  } else if (effect.effect == "clock_jump") {
    out.clock.jump_s = effect.size;
    out.clock.jumps_at_s = time_s;
  } else if (effect.effect == "lens_distortion") {
    add_lens(effect, out.camera);
  } else if (effect.effect == "intrinsics") {
    add_intrinsics(effect, rng, out.camera);
  } else if (effect.effect == "bent_tag") {
    const TagId id = tag_named(robot, effect.place);
    out.bends[id] = bend_of(effect, robot.markers.size_m(id));
  } else if (effect.effect == "rolling_shutter") {
    out.line_s = effect.size;
    out.reference_row = effect.detail * robot.camera.height;
  } else if (effect.effect == "camera_bump") {
    out.bump = bump_of(effect, time_s, rng);
  } else if (effect.effect == "camera_drift") {
    out.drift = drift_of(effect, time_s, robot.last_frame_s, rng);
  } else if (effect.effect == "own_sway") {
    out.sway = sway_of(effect, rng);
  } else if (effect.effect == "focal_jump") {
    out.focus.jump = effect.size;
    out.focus.jumps_at_s = time_s;
  } else if (effect.effect == "focal_drift") {
    out.focus.drift = effect.size;
    out.focus.time_constant_s = time_s;
    out.focus.last_s = robot.last_frame_s;
  } else if (effect.effect == "own_hunting") {
    out.focus.swing = effect.size;
    out.focus.omega = kTwoPi * effect.detail;
  } else if (effect.effect == "thermal_growth") {
    out.growth = {effect.size, time_s, robot.last_frame_s};
  } else if (effect.effect == "own_chequer") {
    const double direction = rng.uniform(0.0, kTwoPi);
    out.chequer = {effect.detail,
                   effect.size * Eigen::Vector2d(std::cos(direction), std::sin(direction))};
  } else if (effect.effect == "blooming") {
    out.bloom_px = effect.size;
  } else if (effect.effect == "own_ripple") {
    out.ripple = ripple_of(effect, rng);
  } else if (effect.effect == "tag_size" && effect.place == "tags") {
    for (const Marker& marker : robot.tree.markers) out.size_factor[marker.id] = 1.0 + effect.size;
  } else if (effect.effect == "tag_size") {
    out.size_factor[tag_named(robot, effect.place)] = 1.0 + effect.size;
  } else if (effect.effect == "tag_slip") {
    const TagId id = tag_named(robot, effect.place);
    out.slips[id] = slip_of(effect, robot.markers.size_m(id), time_s, rng);
  } else {
    KINESCOPE_CHECK(is_mechanical(effect) || effect.effect == "quantisation",
                    "an effect has a known name");
  }
}

// Sees exact corners of one robot at any instant of the camera's clock.
class Eye {
 public:
  Eye(const FilmedRobot& robot, const Mechanics& mechanics, Undeclared undeclared)
      : robot_(robot), mechanics_(mechanics), un_(std::move(undeclared)) {}

  [[nodiscard]] const Clock& clock() const { return un_.clock; }

  // The tag in a frame, or nothing when it shows its back or leaves the image.
  [[nodiscard]] std::optional<std::vector<Eigen::Vector2d>> look(const Marker& marker,
                                                                 double stamp_s) const {
    const Pose T = camera_from_tag(marker, stamp_s);
    if (view_cosine(T) < kFromBehind) return std::nullopt;
    const auto factor = un_.size_factor.find(marker.id);
    const double scale = factor == un_.size_factor.end() ? 1.0 : factor->second;
    const auto bend = un_.bends.find(marker.id);
    std::vector<Eigen::Vector2d> corners;
    for (const Eigen::Vector3d& corner : robot_.markers.corners_m(marker.id)) {
      const Eigen::Vector3d on_tag =
          bend == un_.bends.end() ? corner : bend->second.corner_m(corner);
      const auto pixel = expose(marker, scale * on_tag, stamp_s, T);
      if (!pixel || pixel->x() < 0.0 || pixel->y() < 0.0 || pixel->x() > robot_.camera.width - 1 ||
          pixel->y() > robot_.camera.height - 1)
        return std::nullopt;
      corners.push_back(shifted(*pixel));
    }
    shrink(corners);
    return corners;
  }

  [[nodiscard]] static double view_cosine(const Pose& T_camera_tag) {
    return T_camera_tag.matrix3().col(2).dot(T_camera_tag.translation.normalized());
  }

  [[nodiscard]] Pose camera_from_tag(const Marker& marker, double t_s) const {
    const Pose T_base_link = links_at(t_s)[marker.link.index()];
    Pose T_base_marker = T_base_link * marker.T_link_marker;
    if (marker.link != LinkId{0}) T_base_marker.translation *= un_.growth.factor(t_s);
    Pose T = robot_.T_camera_base * T_base_marker;
    if (un_.bump && t_s >= un_.bump->time_s) T = un_.bump->T_new_old * T;
    if (un_.drift) T = un_.drift->at(t_s) * T;
    if (un_.sway) T = un_.sway->at(t_s) * T;
    const auto slip = un_.slips.find(marker.id);
    if (slip != un_.slips.end() && t_s >= slip->second.time_s) T = T * slip->second.T_before_after;
    return T;
  }

 private:
  // All tags of a frame share one posture unless rows are exposed one after another.
  [[nodiscard]] const std::vector<Pose>& links_at(double t_s) const {
    if (t_s != links_time_s_) links_ = mechanics_.links(un_.clock.log_time(t_s));
    links_time_s_ = t_s;
    return links_;
  }

  // A corner is exposed when its row is: the row and the instant are found together.
  [[nodiscard]] std::optional<Eigen::Vector2d> expose(const Marker& marker,
                                                      const Eigen::Vector3d& corner, double stamp_s,
                                                      const Pose& T_stamp) const {
    CameraModel camera = un_.camera;
    camera.fx *= un_.focus.factor(stamp_s);
    camera.fy *= un_.focus.factor(stamp_s);
    auto pixel = project(camera, T_stamp * corner);
    if (un_.line_s == 0.0) return pixel;
    for (int i = 0; pixel && i < 4; ++i) {
      const double t = stamp_s + un_.line_s * (pixel->y() - un_.reference_row);
      pixel = project(camera, camera_from_tag(marker, t) * corner);
    }
    return pixel;
  }

  [[nodiscard]] Eigen::Vector2d shifted(const Eigen::Vector2d& pixel) const {
    if (un_.ripple) return pixel + std::sin(un_.ripple->per_px.dot(pixel)) * un_.ripple->shift_px;
    if (!un_.chequer) return pixel;
    const double fields = std::floor(pixel.x() / un_.chequer->field_px) +
                          std::floor(pixel.y() / un_.chequer->field_px);
    const bool black = std::fmod(fields, 2.0) == 0.0;
    return pixel + (black ? 1.0 : -1.0) * un_.chequer->shift_px;
  }

  void shrink(std::vector<Eigen::Vector2d>& corners) const {
    if (un_.bloom_px == 0.0) return;
    const std::vector<Eigen::Vector2d> sharp = corners;
    const std::size_t n = sharp.size();
    for (std::size_t i = 0; i < n; ++i) {
      // Where the lines through the neighbours meet once each has moved by that.
      const Eigen::Vector2d one = sharp[(i + 1) % n] - sharp[i];
      const Eigen::Vector2d other = sharp[(i + n - 1) % n] - sharp[i];
      Eigen::Matrix2d normals;
      normals << -one.y(), one.x(), -other.y(), other.x();
      normals.rowwise().normalize();
      Eigen::Vector2d inward = Eigen::Vector2d::Constant(un_.bloom_px);
      if (normals.row(0).dot(other) < 0.0) inward[0] = -inward[0];
      if (normals.row(1).dot(one) < 0.0) inward[1] = -inward[1];
      corners[i] = sharp[i] + normals.inverse() * inward;
    }
  }

  const FilmedRobot& robot_;
  const Mechanics& mechanics_;
  Undeclared un_;
  mutable double links_time_s_ = -1e9;
  mutable std::vector<Pose> links_;
};

// White and correlated noise of one tag's corners. Numbers are drawn for every frame, seen or not,
// so that twins have the same.
class CornerNoise {
 public:
  CornerNoise(const EffectWorldOptions& options, TagId id)
      : options_(options),
        memory_(std::exp(-1.0 / (options.frame_rate_hz * options.correlation_s))),
        rng_(Rng::from_name(fmt::format("corner noise {}", id.value), options.seed)) {
    for (double& value : slow_) value = rng_.normal();
  }

  [[nodiscard]] std::array<Eigen::Vector2d, 4> next() {
    std::array<double, 8> out{};
    const double share = options_.correlated_share;
    for (std::size_t i = 0; i < out.size(); ++i) {
      slow_[i] = memory_ * slow_[i] + std::sqrt(1.0 - memory_ * memory_) * rng_.normal();
      out[i] = std::sqrt(share) * slow_[i] + std::sqrt(1.0 - share) * rng_.normal();
      out[i] *= options_.sigma_px;
    }
    return {{{out[0], out[1]}, {out[2], out[3]}, {out[4], out[5]}, {out[6], out[7]}}};
  }

 private:
  const EffectWorldOptions& options_;
  double memory_;
  std::array<double, 8> slow_{};
  Rng rng_;
};

// Pushes corners outward, the more the flatter the view.
void add_detector_bias(double bias_px, double view_cosine, std::vector<Eigen::Vector2d>& corners) {
  const Eigen::Vector2d middle = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
  for (Eigen::Vector2d& corner : corners) {
    corner += bias_px * (1.0 - view_cosine * view_cosine) * (corner - middle).normalized();
  }
}

void film(const EffectWorldOptions& options, const FilmedRobot& robot, const Mechanics& mechanics,
          const Eye& eye, World& world) {
  std::vector<CornerNoise> noise;
  noise.reserve(robot.tree.markers.size());
  for (const Marker& marker : robot.tree.markers) noise.emplace_back(options, marker.id);
  world.joint_values.resize(options.frames, static_cast<Eigen::Index>(robot.tree.joints.size()));
  for (int f = 0; f < options.frames; ++f) {
    const double stamp_s = f / options.frame_rate_hz;
    world.measurements.times_s.push_back(stamp_s);
    world.joint_values.row(f) = mechanics.values(eye.clock().log_time(stamp_s)).transpose();
    for (std::size_t m = 0; m < robot.tree.markers.size(); ++m) {
      const Marker& marker = robot.tree.markers[m];
      const std::array<Eigen::Vector2d, 4> strays = noise[m].next();
      auto corners = eye.look(marker, stamp_s);
      if (!corners) continue;
      if (options.detector_bias_px != 0.0) {
        const double cosine = Eye::view_cosine(eye.camera_from_tag(marker, stamp_s));
        add_detector_bias(options.detector_bias_px, cosine, *corners);
      }
      for (std::size_t c = 0; c < strays.size(); ++c) (*corners)[c] += strays[c];
      TagObservation seen;
      seen.frame = f;
      seen.id = marker.id;
      seen.sigma_px = options.sigma_px > 0.0 ? options.sigma_px : 0.1;
      seen.corners_px = std::move(*corners);
      world.measurements.corners.push_back(std::move(seen));
    }
  }
}

// Every tag's pose in every frame, from whatever side: what a tracker sees.
void track(const EffectWorldOptions& options, const FilmedRobot& robot, const Eye& eye,
           World& world) {
  PoseTracks& poses = world.measurements.poses;
  poses.times_s = world.measurements.times_s;
  for (const Marker& marker : robot.tree.markers) {
    PoseTrack track;
    track.id = marker.id;
    for (int f = 0; f < options.frames; ++f) {
      PoseSample sample;
      sample.frame = f;
      sample.T_camera_marker = eye.camera_from_tag(marker, f / options.frame_rate_hz);
      track.samples.push_back(sample);
    }
    poses.tracks.push_back(std::move(track));
  }
}

double rounded(double value, double step) {
  return step > 0.0 ? step * std::round(value / step) : value;
}

// Distance of the steps in which a joint's reading comes; 0: none.
double step_of(const EffectWorldOptions& options, const FilmedRobot& robot, const Joint& joint) {
  for (const InjectedEffect& effect : options.effects)
    if (effect.effect == "quantisation" && effect.place == joint.name) return effect.size;
  const bool slides = joint.type == JointType::kPrismatic;
  return options.encoder_step_rad * (slides ? robot.prismatic_m_per_rad : 1.0);
}

void log_encoders(const EffectWorldOptions& options, const FilmedRobot& robot, World& world) {
  Rng rng = Rng::from_name("stamps of a filmed robot", options.seed);
  const double step_s = 1.0 / options.log_rate_hz;
  const int samples = static_cast<int>((robot.duration_s + 2.0 * kLogMargin) * options.log_rate_hz);
  const double begin_s = -kLogMargin + step_s * rng.uniform();
  world.log.values.resize(samples, static_cast<Eigen::Index>(robot.tree.joints.size()));
  for (const Joint& joint : robot.tree.joints) world.log.channels.push_back(joint.name);
  for (int i = 0; i < samples; ++i) {
    const double jitter = options.clock_jitter * rng.uniform(-0.5, 0.5);
    const double t = begin_s + step_s * (i + jitter);
    world.log.times_s.push_back(t);
    for (std::size_t j = 0; j < robot.tree.joints.size(); ++j) {
      world.log.values(i, static_cast<Eigen::Index>(j)) =
          rounded(robot.motions[j].value(t), step_of(options, robot, robot.tree.joints[j]));
    }
  }
}

}  // namespace

FilmedRobot robot_of(const EffectWorldOptions& options) {
  FilmedRobotOptions robot;
  robot.seed = options.seed;
  robot.kind = options.kind;
  robot.duration_s = options.frames / options.frame_rate_hz;
  robot.amplitude_rad = options.amplitude_rad;
  robot.rest_s = options.rest_s;
  robot.tag_size_m = options.tag_size_m;
  robot.scale = options.scale;
  robot.down = options.down;
  FilmedRobot out = draw_filmed_robot(robot);
  out.last_frame_s = (options.frames - 1) / options.frame_rate_hz;
  return out;
}

World make_effect_world(const EffectWorldOptions& options) {
  const FilmedRobot robot = robot_of(options);
  const Mechanics mechanics(robot, options.effects);
  Undeclared undeclared;
  undeclared.camera = robot.camera;
  for (const InjectedEffect& effect : options.effects) add(effect, robot, undeclared);
  World world;
  world.tree = robot.tree;
  world.T_camera_base = robot.T_camera_base;
  world.camera = robot.camera;
  world.markers = robot.markers;
  log_encoders(options, robot, world);
  const Eye eye(robot, mechanics, std::move(undeclared));
  film(options, robot, mechanics, eye, world);
  if (options.poses) track(options, robot, eye, world);
  return world;
}

double twin_distance_px(const World& a, const World& b) {
  std::map<std::pair<int, TagId>, const TagObservation*> seen;
  for (const TagObservation& o : b.measurements.corners) seen[{o.frame, o.id}] = &o;
  double sum = 0.0;
  std::size_t count = 0;
  for (const TagObservation& o : a.measurements.corners) {
    const auto other = seen.find({o.frame, o.id});
    if (other == seen.end()) continue;
    for (std::size_t c = 0; c < o.corners_px.size(); ++c) {
      sum += (o.corners_px[c] - other->second->corners_px[c]).squaredNorm();
    }
    count += o.corners_px.size();
  }
  return count == 0 ? 0.0 : std::sqrt(sum / static_cast<double>(count));
}

}  // namespace kinescope::truth
