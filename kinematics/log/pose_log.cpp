// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/pose_log.h"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace kinescope {
namespace {

// Rotation vector and translation of a row as seen from the chart's rotation.
Vector6d in_chart(const Eigen::Quaterniond& chart, const Pose& pose) {
  Vector6d out;
  out << log_rotation(chart.conjugate() * pose.rotation), pose.translation;
  return out;
}

// Slope at the middle of three points, by the parabola through them.
Vector6d slope(const std::array<double, 3>& t, const std::array<Vector6d, 3>& v) {
  const Vector6d before = (v[1] - v[0]) / (t[1] - t[0]);
  const Vector6d after = (v[2] - v[1]) / (t[2] - t[1]);
  return ((t[2] - t[1]) * before + (t[1] - t[0]) * after) / (t[2] - t[0]);
}

struct Hermite {
  Vector6d value;
  Vector6d rate;
};

Hermite hermite(double u, double step, const Vector6d& a, const Vector6d& b, const Vector6d& da,
                const Vector6d& db) {
  const double u2 = u * u;
  const double u3 = u2 * u;
  return {(2 * u3 - 3 * u2 + 1) * a + (u3 - 2 * u2 + u) * step * da + (3 * u2 - 2 * u3) * b +
              (u3 - u2) * step * db,
          (6 * u2 - 6 * u) / step * (a - b) + (3 * u2 - 4 * u + 1) * da + (3 * u2 - 2 * u) * db};
}

// Between row i and the next, those beside them used where they are no gap away.
PoseAtTime between(const PoseLog& log, std::size_t i, double time_s, double max_gap_s) {
  const Eigen::Quaterniond& chart = log.poses[i].rotation;
  const auto at = [&](std::size_t k) { return in_chart(chart, log.poses[k]); };
  const auto& t = log.times_s;
  const double step = t[i + 1] - t[i];
  const Vector6d chord = (at(i + 1) - at(i)) / step;
  const bool before = i > 0 && t[i] - t[i - 1] <= max_gap_s;
  const bool after = i + 2 < t.size() && t[i + 2] - t[i + 1] <= max_gap_s;
  const Vector6d from =
      before ? slope({t[i - 1], t[i], t[i + 1]}, {at(i - 1), at(i), at(i + 1)}) : chord;
  const Vector6d to =
      after ? slope({t[i], t[i + 1], t[i + 2]}, {at(i), at(i + 1), at(i + 2)}) : chord;
  const Hermite v = hermite((time_s - t[i]) / step, step, at(i), at(i + 1), from, to);
  PoseAtTime out;
  const Eigen::Vector3d turn = v.value.head<3>();
  out.pose = {(chart * exp_rotation(turn)).normalized(), v.value.tail<3>()};
  out.twist << left_jacobian(-turn) * v.rate.head<3>(),  // the right Jacobian
      out.pose.rotation.conjugate() * Eigen::Vector3d(v.rate.tail<3>());
  return out;
}

// Channels that move as the poses do.
JointLog coordinates_of(const PoseLog& log) {
  JointLog out;
  out.times_s = log.times_s;
  out.values.resize(static_cast<Eigen::Index>(log.poses.size()), 7);
  for (std::size_t i = 0; i < log.poses.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    Eigen::Vector4d q = log.poses[i].rotation.coeffs();
    if (i > 0 && q.dot(out.values.row(row - 1).tail<4>().transpose()) < 0.0) q = -q;
    out.values.row(row) << log.poses[i].translation.transpose(), q.transpose();
  }
  for (const char* name : {"x", "y", "z", "qx", "qy", "qz", "qw"}) out.channels.emplace_back(name);
  return out;
}

}  // namespace

std::optional<PoseAtTime> pose_at(const PoseLog& log, double time_s, double max_gap_s) {
  const auto after = std::ranges::upper_bound(log.times_s, time_s);
  if (after == log.times_s.begin()) return std::nullopt;
  const auto i = static_cast<std::size_t>(after - log.times_s.begin()) - 1;
  const bool on_row = log.times_s[i] == time_s;
  const bool last = i + 1 == log.times_s.size();
  if (last && !on_row) return std::nullopt;
  const bool next_near = !last && log.times_s[i + 1] - log.times_s[i] <= max_gap_s;
  if (!log.numbered && next_near) return between(log, i, time_s, max_gap_s);
  if (!on_row) return std::nullopt;
  const bool before_near = i > 0 && time_s - log.times_s[i - 1] <= max_gap_s;
  if (!log.numbered && before_near) return between(log, i - 1, time_s, max_gap_s);
  return PoseAtTime{log.poses[i], Vector6d::Zero()};
}

PoseLog with_rows_moved(PoseLog log, int offset) {
  if (log.numbered) {
    for (double& number : log.times_s) number -= offset;
    return log;
  }
  const auto rows = std::ssize(log.poses);
  const auto cut = std::min<std::ptrdiff_t>(std::abs(offset), rows);
  const auto drop = [&](auto& values, bool from_front) {
    if (values.empty()) return;
    const auto first = from_front ? values.begin() : values.end() - cut;
    values.erase(first, first + cut);
  };
  drop(log.times_s, offset < 0);
  drop(log.poses, offset > 0);
  drop(log.lines, offset > 0);
  return log;
}

bool is_posture_log(const PoseLog& log, const std::vector<double>& times_s) {
  if (log.numbered) return true;
  return is_posture_log(coordinates_of(log), times_s, {0, 1, 2, 3, 4, 5, 6});
}

}  // namespace kinescope
