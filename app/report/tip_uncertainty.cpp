// SPDX-License-Identifier: Apache-2.0
#include "app/report/tip_uncertainty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "calib/bundle/axis_uncertainty.h"
#include "calib/quality/robot_parameters.h"

namespace kinescope::report {
namespace {

// Root mean squares over the frames of the sample recordings are those of all frames to 2 %.
constexpr Eigen::Index kMostPostures = 100;
// Of a common motion, relative: rounding.
constexpr double kRounding = 1e-9;

int moving_joints(const KinematicTree& tree, LinkId link) {
  const std::vector<JointId> path = tree.path_to(link);
  return static_cast<int>(std::ranges::count_if(
      path, [&](const JointId joint) { return is_movable(tree.joints[joint.index()]); }));
}

// The first observed one of those that most joints move.
const Marker* last_marker(const Calibration& calibration) {
  const KinematicTree& tree = calibration.tree;
  const Marker* last = nullptr;
  int most = 0;
  for (std::size_t m = 0; m < tree.markers.size() && m < calibration.markers.size(); ++m) {
    const int joints = moving_joints(tree, tree.markers[m].link);
    if (calibration.markers[m].used == 0 || joints <= most) continue;
    most = joints;
    last = &tree.markers[m];
  }
  return last;
}

bool is_driven(const KinematicTree& tree, LinkId link) {
  return std::ranges::all_of(tree.path_to(link), [&](const JointId id) {
    const Joint& joint = tree.joints[id.index()];
    return !is_movable(joint) || !joint.channel.empty();
  });
}

// Joint values of evenly spaced frames in which all are known.
std::vector<Eigen::VectorXd> observed_postures(const Calibration& calibration) {
  std::vector<Eigen::VectorXd> known;
  if (calibration.joint_values.cols() != std::ssize(calibration.tree.joints)) return known;
  for (Eigen::Index f = 0; f < calibration.joint_values.rows(); ++f) {
    Eigen::VectorXd values = calibration.joint_values.row(f).transpose();
    for (Eigen::Index j = 0; j < values.size(); ++j)
      if (!is_movable(calibration.tree.joints[static_cast<std::size_t>(j)])) values[j] = 0.0;
    if (values.allFinite()) known.push_back(std::move(values));
  }
  if (std::ssize(known) <= kMostPostures) return known;
  std::vector<Eigen::VectorXd> out;
  for (Eigen::Index k = 0; k < kMostPostures; ++k)
    out.push_back(known[static_cast<std::size_t>(k * std::ssize(known) / kMostPostures)]);
  return out;
}

// Moves the marker's mount where the parameter is of it. False: nothing was moved.
bool move_mount(KinematicTree& tree, TagId id, const Parameter& parameter, double step) {
  static constexpr std::array<std::string_view, 6> kWords{" turn x",  " turn y",  " turn z",
                                                          " shift x", " shift y", " shift z"};
  const std::string block = "tag_" + std::to_string(id.value);
  if (parameter.block != block) return false;
  for (std::size_t i = 0; i < kWords.size(); ++i) {
    if (parameter.name != block + std::string(kWords[i])) continue;
    Marker& marker = *std::ranges::find(tree.markers, id, &Marker::id);
    marker.T_link_marker =
        marker.T_link_marker * exp_pose(step * Vector6d::Unit(static_cast<Eigen::Index>(i)));
    return true;
  }
  return false;
}

// A scale moves the values too: value = scale * reading.
Eigen::VectorXd values_in(const KinematicTree& moved, const KinematicTree& tree,
                          Eigen::VectorXd values) {
  for (std::size_t j = 0; j < tree.joints.size(); ++j)
    if (tree.joints[j].scale != 0.0)
      values[static_cast<Eigen::Index>(j)] *= moved.joints[j].scale / tree.joints[j].scale;
  return values;
}

// The marker's pose at each posture, and its derivatives by the calibration's parameters: rotation,
// then translation, in the base's axes about the marker's origin.
struct TipRows {
  std::vector<Eigen::Vector3d> places_m;
  std::vector<Eigen::MatrixXd> J;  // 6 x parameters
};

Pose marker_pose(const KinematicTree& tree, TagId id, const Eigen::VectorXd& values) {
  const Marker& marker = *tree.marker(id);
  return forward_kinematics(tree, values)[marker.link.index()] * marker.T_link_marker;
}

TipRows tip_rows(const Calibration& calibration, TagId id,
                 const std::vector<Eigen::VectorXd>& postures) {
  const KinematicTree& tree = calibration.tree;
  TipRows out;
  std::vector<Eigen::Matrix3d> rotations;
  for (const Eigen::VectorXd& values : postures) {
    const Pose T = marker_pose(tree, id, values);
    out.places_m.push_back(T.translation);
    rotations.push_back(T.matrix3());
    out.J.emplace_back(Eigen::MatrixXd::Zero(6, std::ssize(calibration.parameters)));
  }
  for (std::size_t p = 0; p < calibration.parameters.size(); ++p) {
    const Parameter& parameter = calibration.parameters[p];
    const double step = parameter_step(tree, parameter);
    KinematicTree up = tree, down = tree;
    const auto move = [&](KinematicTree& moved, double by) {
      return move_robot(moved, calibration, parameter, by) || move_mount(moved, id, parameter, by);
    };
    if (!move(up, step)) continue;
    static_cast<void>(move(down, -step));
    for (std::size_t k = 0; k < postures.size(); ++k) {
      const Pose above = marker_pose(up, id, values_in(up, tree, postures[k]));
      const Pose below = marker_pose(down, id, values_in(down, tree, postures[k]));
      const Vector6d twist = log_pose(below.inverse() * above) / (2.0 * step);
      auto column = out.J[k].col(static_cast<Eigen::Index>(p));
      column.head<3>() = rotations[k] * twist.head<3>();
      column.tail<3>() = rotations[k] * twist.tail<3>();
    }
  }
  return out;
}

// Whether the pose depends on estimated joint frames, and on nothing that is undetermined.
bool is_determined(const Calibration& calibration, TagId id, const TipRows& rows) {
  const std::string mount = "tag_" + std::to_string(id.value);
  bool by_joints = false;
  for (std::size_t p = 0; p < calibration.parameters.size(); ++p) {
    const Parameter& parameter = calibration.parameters[p];
    const double unit =
        parameter_step(calibration.tree, parameter) / parameter_step(calibration.tree, Parameter{});
    const bool influences = std::ranges::any_of(rows.J, [&](const Eigen::MatrixXd& J) {
      return has_influence(unit * J.col(static_cast<Eigen::Index>(p)).cwiseAbs().maxCoeff());
    });
    if (!influences) continue;
    if (!parameter.sigma) return false;
    by_joints = by_joints || parameter.block != mount;
  }
  return by_joints;
}

// Derivatives of the marker's pose by a motion of the base about its origin.
Matrix6d by_base(const Eigen::Vector3d& place_m) {
  Matrix6d out = Matrix6d::Identity();
  for (int i = 0; i < 3; ++i) out.block<3, 1>(3, i) = Eigen::Vector3d::Unit(i).cross(place_m);
  return out;
}

// The same, the motion of the base that makes the errors of all places smallest taken out. Nothing
// where it could explain any error.
std::optional<TipRows> without_common_motion(const TipRows& rows) {
  const auto count = std::ssize(rows.J);
  Eigen::MatrixXd errors(3 * count, rows.J.front().cols());
  Eigen::MatrixXd base(3 * count, 6);
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    errors.middleRows<3>(3 * k) = rows.J[at].bottomRows<3>();
    base.middleRows<3>(3 * k) = by_base(rows.places_m[at]).bottomRows<3>();
  }
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(kRounding);
  solver.compute(base);
  if (solver.rank() < 6) return std::nullopt;  // places on a line: a turn about it stays unknown
  const Eigen::MatrixXd motion = solver.solve(errors);
  TipRows out = rows;
  for (std::size_t k = 0; k < out.J.size(); ++k) out.J[k] -= by_base(rows.places_m[k]) * motion;
  return out;
}

struct Spread {
  double square = 0.0;
  double largest = 0.0;
};

// Of three of the six rows. Nothing where a posture has none.
std::optional<Spread> spread_of(const TipRows& rows, Eigen::Index first,
                                const Eigen::MatrixXd& covariance) {
  Spread out;
  for (const Eigen::MatrixXd& J : rows.J) {
    const auto part = J.middleRows<3>(first);
    const Sigma sigma = bundle::length_sigma(part * covariance * part.transpose());
    if (!sigma) return std::nullopt;
    out.square += *sigma * *sigma / static_cast<double>(rows.J.size());
    out.largest = std::max(out.largest, *sigma);
  }
  return out;
}

std::optional<TipFigures> figures_of(const TipRows& rows, const Calibration& calibration) {
  const auto places = spread_of(rows, 3, calibration.covariance);
  if (!places) return std::nullopt;
  TipFigures out{std::sqrt(places->square), std::nullopt};
  if (calibration.kind == MeasurementKind::kPoint) return out;
  if (const auto turns = spread_of(rows, 0, calibration.covariance))
    out.rotation_rad = std::sqrt(turns->square);
  return out;
}

}  // namespace

std::optional<TipUncertainty> tip_uncertainty(const Calibration& calibration) {
  const Marker* marker = last_marker(calibration);
  if (marker == nullptr || !is_driven(calibration.tree, marker->link)) return std::nullopt;
  if (calibration.covariance.rows() != std::ssize(calibration.parameters)) return std::nullopt;
  const std::vector<Eigen::VectorXd> postures = observed_postures(calibration);
  if (postures.empty()) return std::nullopt;
  const TipRows rows = tip_rows(calibration, marker->id, postures);
  if (!is_determined(calibration, marker->id, rows)) return std::nullopt;
  const std::optional<TipFigures> in_base = figures_of(rows, calibration);
  if (!in_base) return std::nullopt;
  TipUncertainty out{.marker = marker->id,
                     .link = marker->link,
                     .joints = moving_joints(calibration.tree, marker->link),
                     .in_base = *in_base};
  out.worst_m = spread_of(rows, 3, calibration.covariance)->largest;
  if (const auto rest = without_common_motion(rows)) out.among = figures_of(*rest, calibration);
  return out;
}

}  // namespace kinescope::report
