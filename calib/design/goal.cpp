// SPDX-License-Identifier: Apache-2.0
#include "calib/design/goal.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::design {
namespace {

// Postures over which the tip's error is averaged: with 100 the root mean square over a six-axis
// arm's range differs by 3 % from draw to draw, and the design by less.
constexpr int kWorkspace = 100;
constexpr int kMostDraws = 100000;
constexpr int kFirstPoint = 1 << 24;   // ids of points on axes, beyond those of any family
constexpr double kLeastLever_m = 0.1;  // as of directions against places in axis_uncertainty.cpp
constexpr double kNothing = 1e-12;     // of the largest eigenvalue: rounding

// Points of the tree's markers in some postures, as a tracker would see them; ids in `ids`.
ExpectedRecording points_at(const PlannedRobot& robot, const JointSpace& space,
                            const std::vector<Eigen::VectorXd>& postures,
                            const std::vector<TagId>& ids) {
  ExpectedRecording out = recording_at(robot, space, postures);
  out.measurements.corners.clear();
  for (std::size_t f = 0; f < postures.size(); ++f) {
    for (const TagId id : ids) {
      PointObservation point;
      point.frame = static_cast<int>(f);
      point.id = id;
      point.position_m = Eigen::Vector3d::Zero();  // rows are derivatives alone
      point.sigma_m = 1.0;
      out.measurements.points.observations.push_back(point);
    }
  }
  out.measurements.points.times_s = out.measurements.times_s;
  return out;
}

// A stack of rows by the names of its columns.
struct NamedRows {
  Eigen::MatrixXd by_base;  // rows x 6
  Eigen::MatrixXd rows;     // rows x parameters
};

NamedRows named(const ExpectedRows& expected, const std::vector<Parameter>& parameters) {
  Eigen::Index count = 0;
  for (const Eigen::MatrixXd& J : expected.J) count += J.rows();
  Eigen::MatrixXd stack(count, std::ssize(expected.parameters));
  Eigen::Index at = 0;
  for (const Eigen::MatrixXd& J : expected.J) {
    stack.middleRows(at, J.rows()) = J;
    at += J.rows();
  }
  std::map<std::string, Eigen::Index> column;
  std::vector<Eigen::Index> camera;
  for (std::size_t i = 0; i < expected.parameters.size(); ++i) {
    column[expected.parameters[i].name] = static_cast<Eigen::Index>(i);
    if (expected.parameters[i].block == "camera") camera.push_back(static_cast<Eigen::Index>(i));
  }
  NamedRows out{stack(Eigen::all, camera), Eigen::MatrixXd::Zero(count, std::ssize(parameters))};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto found = column.find(parameters[i].name);
    if (found == column.end() || is_of_recording(parameters[i])) continue;
    out.rows.col(static_cast<Eigen::Index>(i)) = stack.col(found->second);
  }
  return out;
}

// root root' = rows' rows / points, the common motion taken out.
Eigen::MatrixXd root_of(const NamedRows& stack, double points) {
  const Eigen::MatrixXd rest =
      stack.rows - stack.by_base * least_squares(stack.by_base, stack.rows);
  const SymmetricEigen eigen = symmetric_eigen(rest.transpose() * rest / points);
  const double least = kNothing * std::max(eigen.values[eigen.values.size() - 1], 0.0);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < eigen.values.size(); ++i)
    if (eigen.values[i] > least) kept.push_back(i);
  const Eigen::VectorXd scale = eigen.values(kept).cwiseSqrt();
  return eigen.vectors(Eigen::all, kept) * scale.asDiagonal();
}

// Markers on links that carry no further joint.
std::vector<TagId> tips(const KinematicTree& tree) {
  std::vector<TagId> out;
  for (const Marker& marker : tree.markers) {
    const bool carries = std::ranges::any_of(
        tree.joints, [&](const Joint& joint) { return joint.parent == marker.link; });
    if (!carries && marker.link.value != 0) out.push_back(marker.id);
  }
  return out;
}

std::vector<Eigen::VectorXd> workspace(const JointSpace& space, Rng& rng) {
  std::vector<Eigen::VectorXd> out;
  for (int draw = 0; draw < kMostDraws && std::ssize(out) < kWorkspace; ++draw)
    if (auto readings = space.draw(rng)) out.push_back(std::move(*readings));
  return out;
}

Eigen::MatrixXd tip_root(const PlannedRobot& robot, const JointSpace& space,
                         const std::vector<Parameter>& parameters, Rng& rng) {
  const std::vector<TagId> ids = tips(robot.calibration.tree);
  const std::vector<Eigen::VectorXd> postures = workspace(space, rng);
  const ExpectedRows rows =
      expected_rows(robot.calibration, points_at(robot, space, postures, ids));
  return root_of(named(rows, parameters), static_cast<double>(ids.size() * postures.size()));
}

// Root mean square distance of the joints from their middle, m.
double lever(const KinematicTree& tree, const std::vector<Pose>& T_base_link) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double square = 0.0, count = 0.0;
  for (const Joint& joint : tree.joints) {
    if (joint.type != JointType::kRevolute) continue;
    const Eigen::Vector3d& at = T_base_link[joint.child.index()].translation;
    sum += at;
    square += at.squaredNorm();
    count += 1.0;
  }
  if (count == 0.0) return kLeastLever_m;
  return std::max(kLeastLever_m,
                  std::sqrt(std::max(0.0, square / count - (sum / count).squaredNorm())));
}

// What moves a point of an axis sideways, two rows each: of the two points on it, of a slide of
// half their difference.
NamedRows sideways(const NamedRows& points, const KinematicTree& tree,
                   const std::vector<Pose>& T_camera_link, const std::vector<std::size_t>& joints) {
  std::vector<Eigen::MatrixXd> rows, by_base;
  const auto add = [](const Eigen::MatrixXd& all, std::size_t k, const Eigen::MatrixXd& across,
                      bool slides, std::vector<Eigen::MatrixXd>& out) {
    const auto at = static_cast<Eigen::Index>(6 * k);
    const Eigen::MatrixXd a = across * all.middleRows(at, 3);
    const Eigen::MatrixXd b = across * all.middleRows(at + 3, 3);
    if (slides) {
      out.push_back(0.5 * (a - b));
      return;
    }
    out.push_back(a);
    out.push_back(b);
  };
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const Joint& joint = tree.joints[joints[k]];
    const Eigen::Vector3d axis = T_camera_link[joint.child.index()].rotation * joint.axis;
    const Eigen::MatrixXd across = rotation_to_axis(axis).toRotationMatrix().transpose().topRows(2);
    const bool slides = joint.type == JointType::kPrismatic;
    add(points.rows, k, across, slides, rows);
    add(points.by_base, k, across, slides, by_base);
  }
  NamedRows out{Eigen::MatrixXd(2 * std::ssize(rows), points.by_base.cols()),
                Eigen::MatrixXd(2 * std::ssize(rows), points.rows.cols())};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.rows.middleRows(2 * static_cast<Eigen::Index>(i), 2) = rows[i];
    out.by_base.middleRows(2 * static_cast<Eigen::Index>(i), 2) = by_base[i];
  }
  return out;
}

Eigen::MatrixXd axes_root(const PlannedRobot& robot, const JointSpace& space,
                          const std::vector<Parameter>& parameters) {
  const Eigen::VectorXd readings = space.middle();
  const KinematicTree& tree = robot.calibration.tree;
  std::vector<Pose> T_camera_link = forward_kinematics(tree, space.values(readings));
  const double lever_m = lever(tree, T_camera_link);
  for (Pose& pose : T_camera_link) pose = robot.calibration.T_camera_base * pose;
  PlannedRobot marked = robot;
  std::vector<TagId> ids;
  std::vector<std::size_t> joints;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    if (joint.type == JointType::kFixed) continue;
    joints.push_back(j);
    for (const double side : {lever_m, -lever_m}) {
      Marker point;
      point.id = TagId{kFirstPoint + static_cast<int>(ids.size())};
      point.link = joint.child;
      point.T_link_marker.translation = side * joint.axis;
      ids.push_back(point.id);
      marked.calibration.tree.markers.push_back(point);
    }
  }
  const ExpectedRows rows =
      expected_rows(marked.calibration, points_at(marked, space, {readings}, ids));
  const NamedRows points = named(rows, parameters);
  const NamedRows across = sideways(points, tree, T_camera_link, joints);
  return root_of(across, 0.5 * static_cast<double>(across.rows.rows()));
}

}  // namespace

Eigen::MatrixXd goal_root(Goal goal, const PlannedRobot& robot, const JointSpace& space,
                          const std::vector<Parameter>& parameters, Rng& rng) {
  return goal == Goal::kTip ? tip_root(robot, space, parameters, rng)
                            : axes_root(robot, space, parameters);
}

}  // namespace kinescope::design
