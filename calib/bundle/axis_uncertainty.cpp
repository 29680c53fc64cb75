// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/axis_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "calib/bundle/linearise.h"
#include "kinematics/core/chi_square.h"

namespace kinescope::bundle {
namespace {

// Weighs directions against places where all axes meet.
constexpr double kLeastExtent_m = 0.1;

// Of derivatives, relative: rounding.
constexpr double kNothing = 1e-6;

// Derivatives of what tilts an axis (2 rows) and, of a revolute joint, of what moves it sideways.
struct Axis {
  std::size_t joint = 0;
  Eigen::Vector3d point_m;
  Eigen::MatrixXd tilt, shift;            // by the parameters
  Eigen::MatrixXd tilt_base, shift_base;  // by a motion of the base
};

std::optional<Axis> axis_of(const Spec& spec, const State& state, const Uncertainty& uncertainty,
                            const std::map<const double*, PoseColumns>& columns,
                            const KinematicTree& tree, const std::vector<Pose>& T_base_link,
                            std::size_t j) {
  const Joint& joint = tree.joints[j];
  const Pose T_base_joint = T_base_link[joint.parent.index()] * joint.T_parent_joint;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(6, uncertainty.covariance.rows());
  for (const JointId up : spec.tree.path_to(joint.child)) {
    const auto found = columns.find(state.joint_frames[up.index()].data());
    if (found == columns.end()) continue;
    const Joint& above = tree.joints[up.index()];
    const Pose T_base_above = T_base_link[above.parent.index()] * above.T_parent_joint;
    const Matrix6d carry = adjoint(T_base_joint.inverse() * T_base_above);
    for (int i = 0; i < 6; ++i) {
      const int column = found->second[static_cast<std::size_t>(i)];
      if (column < 0) continue;
      if (!uncertainty.parameters[static_cast<std::size_t>(column)].sigma) return std::nullopt;
      A.col(column) += carry.col(i);
    }
  }
  const Eigen::Matrix3d R = rotation_to_axis(joint.axis).toRotationMatrix().transpose();
  const Matrix6d base = adjoint(T_base_joint.inverse());
  Axis out;
  out.joint = j;
  out.point_m = T_base_joint.translation;
  out.tilt = (R * A.topRows<3>()).topRows<2>();
  out.tilt_base = (R * base.topRows<3>()).topRows<2>();
  if (joint.type == JointType::kRevolute) {
    out.shift = (R * A.bottomRows<3>()).topRows<2>();
    out.shift_base = (R * base.bottomRows<3>()).topRows<2>();
  }
  return out;
}

// Root mean square distance of the revolute axes' points from their middle, m.
double extent(const std::vector<Axis>& axes) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double square = 0.0;
  double count = 0.0;
  for (const Axis& axis : axes) {
    if (axis.shift.rows() == 0) continue;
    sum += axis.point_m;
    square += axis.point_m.squaredNorm();
    count += 1.0;
  }
  if (count == 0.0) return kLeastExtent_m;
  const double variance = square / count - (sum / count).squaredNorm();
  return std::max(kLeastExtent_m, std::sqrt(std::max(0.0, variance)));
}

// By the parameters: the motion of the base that makes all axes' errors smallest.
// Nothing where it could explain any error.
std::optional<Eigen::MatrixXd> common_motion(const std::vector<Axis>& axes) {
  const double metre = 1.0 / extent(axes);
  Eigen::Index rows = 0;
  for (const Axis& axis : axes) rows += axis.tilt.rows() + axis.shift.rows();
  if (rows == 0) return std::nullopt;
  Eigen::MatrixXd errors(rows, axes.front().tilt.cols());
  Eigen::MatrixXd by_base(rows, 6);
  Eigen::Index at = 0;
  for (const Axis& axis : axes) {
    errors.middleRows(at, 2) = axis.tilt;
    by_base.middleRows(at, 2) = axis.tilt_base;
    at += 2;
    if (axis.shift.rows() == 0) continue;
    errors.middleRows(at, 2) = metre * axis.shift;
    by_base.middleRows(at, 2) = metre * axis.shift_base;
    at += 2;
  }
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(1e-9);
  solver.compute(by_base);
  if (solver.rank() >= rows) return std::nullopt;
  return solver.solve(errors);
}

}  // namespace

Sigma length_sigma(const Eigen::MatrixXd& covariance) {
  constexpr double kNormal95 = 1.6449;  // 95 % quantile of the normal distribution
  const double mean = covariance.trace();
  const double square = covariance.squaredNorm();
  if (!(mean > 0.0) || !std::isfinite(square)) return std::nullopt;
  const double freedom = mean * mean / square;
  return 0.5 * std::sqrt(mean / freedom * chi_square_quantile(freedom, kNormal95));
}

void fill_axis_uncertainty(const Spec& spec, const State& state, const Uncertainty& uncertainty,
                           const KinematicTree& tree, const Eigen::VectorXd& values,
                           const std::vector<bool>& held, std::vector<JointEstimate>& joints) {
  const Eigen::MatrixXd& covariance = uncertainty.covariance;
  if (covariance.rows() == 0) return;
  const auto columns = pose_columns(uncertainty.blocks);
  const std::vector<Pose> T_base_link = forward_kinematics(tree, values);
  std::vector<Axis> axes;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    if (tree.joints[j].type == JointType::kFixed || held[j]) continue;
    if (auto axis = axis_of(spec, state, uncertainty, columns, tree, T_base_link, j))
      axes.push_back(std::move(*axis));
  }
  const auto sigma_of = [&](const Eigen::MatrixXd& A) {
    return length_sigma(A * covariance * A.transpose());
  };
  const std::optional<Eigen::MatrixXd> motion = common_motion(axes);
  for (const Axis& axis : axes) {
    JointEstimate& joint = joints[axis.joint];
    const bool turns = axis.shift.rows() > 0;
    joint.direction_sigma_rad = sigma_of(axis.tilt);
    if (turns) joint.position_sigma_m = sigma_of(axis.shift);
    if (!motion) continue;
    const auto left = [&](const Eigen::MatrixXd& A, const Eigen::MatrixXd& by_base) -> Sigma {
      const Eigen::MatrixXd rest = A - by_base * *motion;
      if (rest.norm() <= kNothing * A.norm()) return std::nullopt;
      return sigma_of(rest);
    };
    joint.among_direction_sigma_rad = left(axis.tilt, axis.tilt_base);
    if (turns) joint.among_position_sigma_m = left(axis.shift, axis.shift_base);
  }
}

}  // namespace kinescope::bundle
