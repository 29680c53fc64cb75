// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/random_robot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <fmt/format.h>

namespace kinescope {
namespace {

Eigen::Quaterniond random_rotation(Rng& rng) {
  Eigen::Vector4d v(rng.normal(), rng.normal(), rng.normal(), rng.normal());
  while (v.norm() < 1e-6)
    v = Eigen::Vector4d(rng.normal(), rng.normal(), rng.normal(), rng.normal());
  v.normalize();
  return {v(0), v(1), v(2), v(3)};
}

std::vector<int> permutation(int count, Rng& rng) {
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  for (int i = count - 1; i > 0; --i) {
    std::swap(order[static_cast<std::size_t>(i)],
              order[static_cast<std::size_t>(rng.index(i + 1))]);
  }
  return order;
}

// A motion bounded by 1: three sines.
struct Motion {
  std::array<double, 3> amplitude{};
  std::array<double, 3> frequency_hz{};
  std::array<double, 3> phase{};

  [[nodiscard]] double at(double t) const {
    double sum = 0.0;
    for (std::size_t s = 0; s < 3; ++s) {
      sum += amplitude[s] * std::sin(2.0 * std::numbers::pi * frequency_hz[s] * t + phase[s]);
    }
    return sum;
  }
};

Motion random_motion(const RecordingOptions& options, Rng& rng) {
  Motion m;
  double sum = 0.0;
  for (std::size_t s = 0; s < 3; ++s) {
    m.amplitude[s] = rng.uniform(0.3, 1.0);
    m.frequency_hz[s] = rng.uniform(options.lowest_hz, options.highest_hz);
    m.phase[s] = rng.uniform(0.0, 2.0 * std::numbers::pi);
    sum += m.amplitude[s];
  }
  for (double& a : m.amplitude) a /= sum;
  return m;
}

// The joints' motions in units of their amplitude, as the encoders see them.
class Motions {
 public:
  Motions(const RandomRobot& robot, const RecordingOptions& options, Rng& rng)
      : robot_(robot), options_(options) {
    for (std::size_t j = 0; j < robot.tree.joints.size(); ++j)
      motions_.push_back(random_motion(options, rng));
    for (const auto& [a, b] : options.together)
      motions_[static_cast<std::size_t>(b)] = motions_[static_cast<std::size_t>(a)];
    for (const int j : options.still_joints) motions_[static_cast<std::size_t>(j)].amplitude = {};
  }

  // rad or m per unit of motion.
  [[nodiscard]] double size(std::size_t joint) const {
    const bool slides = robot_.tree.joints[joint].type == JointType::kPrismatic;
    return options_.amplitude_rad * (slides ? options_.prismatic_m_per_rad : 1.0);
  }

  [[nodiscard]] double encoder(std::size_t joint, double t) const { return motions_[joint].at(t); }

  // What the link does: coupling with the joint before, and backlash, which remembers.
  [[nodiscard]] Eigen::MatrixXd links(const std::vector<double>& times) const {
    const std::size_t joints = motions_.size();
    Eigen::MatrixXd out(static_cast<Eigen::Index>(times.size()), static_cast<Eigen::Index>(joints));
    const double gap =
        options_.amplitude_rad > 0.0 ? options_.backlash_rad / options_.amplitude_rad : 0.0;
    for (std::size_t j = 0; j < joints; ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      // The play's memory is started a while before the first frame.
      double held = encoder(j, times.front() - 2.0);
      const auto follow = [&](double t) {
        const double q = encoder(j, t);
        held = std::clamp(held, q - 0.5 * gap, q + 0.5 * gap);
      };
      for (double t = times.front() - 2.0; t < times.front(); t += 0.01) follow(t);
      for (std::size_t f = 0; f < times.size(); ++f) {
        follow(times[f]);
        out(static_cast<Eigen::Index>(f), column) = held;
      }
    }
    Eigen::MatrixXd coupled = out;
    for (std::size_t j = 0; j < joints; ++j) {
      const int parent = robot_.tree.joints[j].parent.value;
      if (parent == 0) continue;
      coupled.col(static_cast<Eigen::Index>(j)) += options_.coupling * out.col(parent - 1);
    }
    for (std::size_t j = 0; j < joints; ++j) coupled.col(static_cast<Eigen::Index>(j)) *= size(j);
    return coupled;
  }

 private:
  const RandomRobot& robot_;
  const RecordingOptions& options_;
  std::vector<Motion> motions_;
};

// Covariance of the pose of a square of 5 cm whose corners a camera of 900 px focal length sees
// with `corner_px`: large in depth and tilt, the more so the further away (right perturbation).
Matrix6d target_covariance(const Pose& T, double corner_px) {
  constexpr double kFocal = 900.0;
  constexpr double kHalf = 0.025;
  Matrix6d information = Matrix6d::Zero();
  for (const double x : {-kHalf, kHalf}) {
    for (const double y : {-kHalf, kHalf}) {
      const Eigen::Vector3d corner(x, y, 0.0);
      const Eigen::Vector3d p = T * corner;
      Eigen::Matrix<double, 2, 3> projection;
      projection << 1.0, 0.0, -p.x() / p.z(), 0.0, 1.0, -p.y() / p.z();
      projection *= kFocal / p.z();
      Eigen::Matrix<double, 3, 6> move;
      Eigen::Matrix3d cross;
      cross << 0.0, -corner.z(), corner.y(), corner.z(), 0.0, -corner.x(), -corner.y(), corner.x(),
          0.0;
      move << -cross, Eigen::Matrix3d::Identity();
      const Eigen::Matrix<double, 2, 6> J = projection * T.matrix3() * move;
      information += J.transpose() * J / (corner_px * corner_px);
    }
  }
  // Head on, the corners hardly show a tilt: no more than 0.1 rad of doubt.
  information.topLeftCorner<3, 3>().diagonal().array() += 100.0;
  return information.inverse();
}

Matrix6d noise_covariance(const Pose& truth, const RecordingOptions& o) {
  if (o.corner_px > 0.0) return target_covariance(truth, o.corner_px);
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(o.sigma_rad * o.sigma_rad),
      Eigen::Vector3d::Constant(o.sigma_m * o.sigma_m);
  return variance.asDiagonal();
}

Vector6d pose_noise(const Matrix6d& covariance, Rng& rng) {
  Vector6d d;
  d << rng.normal3(), rng.normal3();
  return covariance.llt().matrixL() * d;
}

PoseSample sample_of(const Pose& truth, int frame, const RecordingOptions& o, Rng& rng) {
  PoseSample s;
  s.frame = frame;
  const Matrix6d covariance = noise_covariance(truth, o);
  s.T_camera_marker = truth * exp_pose(pose_noise(covariance, rng));
  s.covariance = covariance * (o.declared_noise * o.declared_noise);
  const bool flip = rng.uniform() < o.flip_share;
  const Pose other = flipped_pose(s.T_camera_marker);
  // The better branch is the true one most of the time; a flip is one where it is not.
  const double cost = rng.uniform(0.0, flip ? 2.0 : 10.0);
  if (o.alternatives) {
    s.T_camera_marker_alternative = flip ? s.T_camera_marker : other;
    s.alternative_cost = cost;
  }
  if (flip) s.T_camera_marker = other;
  return s;
}

void record_tracks(const RandomRobot& robot, const RecordingOptions& o, Rng& rng,
                   RobotRecording& out) {
  for (const Marker& marker : robot.tree.markers) out.tracks.tracks.push_back({marker.id, {}});
  for (std::size_t f = 0; f < out.tracks.times_s.size(); ++f) {
    const auto row = static_cast<Eigen::Index>(f);
    const auto poses = forward_kinematics(robot.tree, out.joint_values.row(row).transpose());
    for (std::size_t m = 0; m < robot.tree.markers.size(); ++m) {
      const Marker& marker = robot.tree.markers[m];
      const Pose truth = robot.T_camera_base * poses[marker.link.index()] * marker.T_link_marker;
      const bool missing = rng.uniform() < o.missing_share;
      PoseSample s = sample_of(truth, static_cast<int>(f), o, rng);
      if (!missing) out.tracks.tracks[m].samples.push_back(std::move(s));
    }
  }
  std::ranges::sort(out.tracks.tracks, {}, &PoseTrack::id);
}

void record_log(const Motions& motions, const RandomRobot& robot, const RecordingOptions& o,
                Rng& rng, RobotRecording& out) {
  const int joints = static_cast<int>(robot.tree.joints.size());
  const int channels = joints + o.idle_channels;
  const std::vector<int> place =
      o.shuffle_channels ? permutation(channels, rng) : permutation(0, rng);
  const double end = out.tracks.times_s.back() + o.log_margin_s;
  for (double t = -o.log_margin_s; t < end; t += 1.0 / o.log_rate_hz)
    out.log.times_s.push_back(t + o.lag_s);
  out.log.values.resize(static_cast<Eigen::Index>(out.log.size()), channels);
  out.channel_of_joint.resize(static_cast<std::size_t>(joints));
  for (int c = 0; c < channels; ++c) out.log.channels.push_back(fmt::format("ch{}", c));
  for (int j = 0; j < channels; ++j) {
    const int c = o.shuffle_channels ? place[static_cast<std::size_t>(j)] : j;
    const Motion idle = random_motion(o, rng);
    double scale = o.channel_scale;
    double zero = 0.0;
    if (o.ticks) {
      scale = std::round(rng.uniform(500.0, 40000.0));
      zero = std::round(rng.uniform(0.0, 65536.0));
    }
    if (o.random_signs && rng.uniform() < 0.5) scale = -scale;
    const double size = j < joints ? motions.size(static_cast<std::size_t>(j)) : o.amplitude_rad;
    for (std::size_t i = 0; i < out.log.size(); ++i) {
      const double t = out.log.times_s[i] - o.lag_s;
      const double motion =
          j < joints ? motions.encoder(static_cast<std::size_t>(j), t) : idle.at(t);
      double reading = scale * size * motion + zero;
      if (o.ticks) reading = std::round(reading);
      out.log.values(static_cast<Eigen::Index>(i), c) = reading;
    }
    if (j >= joints) continue;
    out.channel_of_joint[static_cast<std::size_t>(j)] = c;
    out.scale_of_joint.push_back(1.0 / scale);
  }
}

bool is_unmarked(const RandomRobotOptions& options, int link) {
  return std::ranges::find(options.unmarked_links, link) != options.unmarked_links.end();
}

void add_markers(const RandomRobotOptions& options, Rng& rng, KinematicTree& tree) {
  for (int l = 0; l <= options.joints; ++l) {
    if (is_unmarked(options, l) || (l == 0 && !options.base_marker)) continue;
    for (int m = 0; m < options.markers_per_link; ++m) {
      tree.markers.push_back({TagId{0},
                              LinkId{l},
                              {random_rotation(rng), options.marker_offset_m * rng.unit3()},
                              0.04});
    }
  }
  const auto count = static_cast<int>(tree.markers.size());
  const std::vector<int> ids = permutation(count, rng);
  for (int m = 0; m < count; ++m) {
    tree.markers[static_cast<std::size_t>(m)].id =
        TagId{options.shuffle_ids ? ids[static_cast<std::size_t>(m)] : m};
  }
}

}  // namespace

Pose flipped_pose(const Pose& T) {
  const Eigen::Vector3d sight = T.translation.normalized();
  Eigen::Vector3d normal = T.rotation * Eigen::Vector3d::UnitZ();
  if (normal.dot(sight) < 0.0) normal = -normal;
  const Eigen::Vector3d mirrored = 2.0 * normal.dot(sight) * sight - normal;
  return {(Eigen::Quaterniond::FromTwoVectors(normal, mirrored) * T.rotation).normalized(),
          T.translation};
}

RandomRobot random_robot(const RandomRobotOptions& options, Rng& rng) {
  RandomRobot robot;
  robot.tree.links.push_back({"base"});
  const Eigen::Vector3d common = rng.unit3();
  // Axes that are to be parallel are so when all joints are at zero and all frames keep one
  // orientation.
  for (int j = 0; j < options.joints; ++j) {
    robot.tree.links.push_back({fmt::format("link{}", j + 1)});
    Joint joint;
    joint.name = fmt::format("joint{}", j + 1);
    joint.type =
        rng.uniform() < options.prismatic_share ? JointType::kPrismatic : JointType::kRevolute;
    joint.parent = LinkId{options.tree ? rng.index(j + 1) : j};
    joint.child = LinkId{j + 1};
    joint.T_parent_joint.translation = options.link_offset_m * rng.unit3();
    if (options.parallel_axes) {
      joint.axis = common;
      const Eigen::Vector3d across = joint.T_parent_joint.translation.cross(common);
      if (across.norm() > 1e-3)
        joint.T_parent_joint.translation = options.link_offset_m * across.normalized();
    } else {
      joint.T_parent_joint.rotation = random_rotation(rng);
      joint.axis = rng.unit3();
    }
    robot.tree.joints.push_back(std::move(joint));
  }
  add_markers(options, rng, robot.tree);
  robot.T_camera_base = {
      random_rotation(rng),
      Eigen::Vector3d(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(1.3, 2.0))};
  return robot;
}

RobotRecording record(const RandomRobot& robot, const RecordingOptions& options, Rng& rng) {
  RobotRecording out;
  const Motions motions(robot, options, rng);
  for (int f = 0; f < options.frames; ++f) out.tracks.times_s.push_back(f / options.rate_hz);
  out.joint_values = motions.links(out.tracks.times_s);
  record_log(motions, robot, options, rng, out);
  record_tracks(robot, options, rng, out);
  return out;
}

}  // namespace kinescope
