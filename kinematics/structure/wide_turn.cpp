// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/wide_turn.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "kinematics/core/dense_algebra.h"

namespace kinescope::structure_search {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

// The axis all increments between neighbours in `order` share (unit, child frame): their principal
// direction.
Eigen::Vector3d shared_axis(const Motion& motion, const std::vector<std::size_t>& order) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Eigen::Vector3d w = log_rotation(motion[order[i - 1]].pose.rotation.conjugate() *
                                           motion[order[i]].pose.rotation);
    sum += w * w.transpose();
  }
  return symmetric_eigen(sum).vectors.col(2);
}

// Angle about `axis` from the first sample of `order`, unwrapped from neighbour to neighbour. The
// angle of R about u is 2 atan2(u . vec, w), exact when R turns about u alone.
std::vector<double> unwrapped_angles(const Motion& motion, const std::vector<std::size_t>& order,
                                     const Eigen::Vector3d& axis) {
  std::vector<double> angle(motion.size(), 0.0);
  const Eigen::Quaterniond first = motion[order.front()].pose.rotation.conjugate();
  double previous = 0.0;
  for (const std::size_t i : order) {
    const Eigen::Quaterniond r = first * motion[i].pose.rotation;
    double a = 2.0 * std::atan2(axis.dot(r.vec()), r.w());
    a += kTwoPi * std::round((previous - a) / kTwoPi);
    angle[i] = a;
    previous = a;
  }
  return angle;
}

struct Line {
  double slope = 0.0;
  double intercept = 0.0;
};

Line line_through(const std::vector<double>& angle, const Eigen::RowVectorXd& q) {
  const Eigen::Map<const Eigen::RowVectorXd> a(angle.data(),
                                               static_cast<Eigen::Index>(angle.size()));
  const double q_mean = q.mean();
  const double a_mean = a.mean();
  const double qq = (q.array() - q_mean).square().sum();
  const double slope = ((q.array() - q_mean) * (a.array() - a_mean)).sum() / std::max(qq, 1e-12);
  return {slope, a_mean - slope * q_mean};
}

// A point of the axis in the parent (x) and the child (y): p = x - R y, least squares.
std::pair<Eigen::Vector3d, Eigen::Vector3d> axis_points(const Motion& motion) {
  Matrix6d H = 1e-6 * Matrix6d::Identity();
  Vector6d g = Vector6d::Zero();
  for (const MotionSample& sample : motion) {
    Eigen::Matrix<double, 3, 6> J;
    J << Eigen::Matrix3d::Identity(), -sample.pose.matrix3();
    H.noalias() += J.transpose() * J;
    g.noalias() += J.transpose() * sample.pose.translation;
  }
  const Vector6d x = solve_symmetric(H, g);
  return {x.head<3>(), x.tail<3>()};
}

Candidate candidate_from(const Motion& motion, std::size_t first, const Eigen::Vector3d& axis) {
  Candidate c;
  const auto [x, y] = axis_points(motion);
  const Eigen::Quaterniond R0 = motion[first].pose.rotation;
  ChainJoint joint;
  joint.type = JointType::kRevolute;
  joint.frame = {rotation_to_axis(R0 * axis), x};
  c.start.mount = {R0, x - R0 * y};
  c.start.joints = {std::move(joint)};
  return c;
}

// Turns the mount by `angle` about the joint, so that coordinates may be counted from elsewhere.
void turn_mount(ChainModel& model, double angle) {
  const Pose& F = model.joints.front().frame;
  const Pose turn{Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())),
                  Eigen::Vector3d::Zero()};
  model.mount = F * turn * F.inverse() * model.mount;
}

// What the start leaves, after two iterations.
void judge_start(const Motion& motion, const Eigen::MatrixXd& q, Candidate& c) {
  Motion numbered = motion;
  for (std::size_t i = 0; i < numbered.size(); ++i) numbered[i].instant = static_cast<int>(i);
  const ChainFit fit = fit_chain(numbered, q.transpose(), c.start, {.max_iterations = 2});
  c.cost = fit.cost;
  c.across = fit.variance;
}

}  // namespace

std::vector<Candidate> wide_turn_candidates(const Motion& motion, const Eigen::MatrixXd& q,
                                            const std::vector<char>& usable, bool coordinate_free) {
  std::vector<Candidate> out;
  std::vector<std::size_t> order(motion.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (coordinate_free) {
    const Eigen::Vector3d axis = shared_axis(motion, order);
    Candidate c = candidate_from(motion, order.front(), axis);
    c.start.coordinates = unwrapped_angles(motion, order, axis);
    double mean = 0.0;
    for (const double a : c.start.coordinates) mean += a / static_cast<double>(motion.size());
    for (double& a : c.start.coordinates) a -= mean;
    turn_mount(c.start, mean);
    judge_start(motion, q, c);
    out.push_back(std::move(c));
  }
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    if (usable[static_cast<std::size_t>(k)] == 0) continue;
    std::ranges::stable_sort(order, {},
                             [&](std::size_t i) { return q(k, static_cast<Eigen::Index>(i)); });
    const Eigen::Vector3d axis = shared_axis(motion, order);
    const Line line = line_through(unwrapped_angles(motion, order, axis), q.row(k));
    Candidate c = candidate_from(motion, order.front(), axis);
    c.channel = static_cast<int>(k);
    c.start.joints.front().terms = {{c.channel, line.slope}};
    turn_mount(c.start, line.intercept);
    judge_start(motion, q, c);
    out.push_back(std::move(c));
  }
  return out;
}

}  // namespace kinescope::structure_search
