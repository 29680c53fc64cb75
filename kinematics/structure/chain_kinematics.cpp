// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain_kinematics.h"

#include <cmath>

#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// The joint's motion after a pose: motion * T.
Pose moved(JointType type, double value, const Pose& T) {
  if (type == JointType::kPrismatic) {
    return {T.rotation, {T.translation.x(), T.translation.y(), T.translation.z() + value}};
  }
  const double c = std::cos(0.5 * value);
  const double s = std::sin(0.5 * value);
  const Eigen::Quaterniond& q = T.rotation;
  const double cosine = c * c - s * s;
  const double sine = 2.0 * s * c;
  const Eigen::Vector3d& p = T.translation;
  return {Eigen::Quaterniond(c * q.w() - s * q.z(), c * q.x() - s * q.y(), c * q.y() + s * q.x(),
                             c * q.z() + s * q.w()),
          {cosine * p.x() - sine * p.y(), sine * p.x() + cosine * p.y(), p.z()}};
}

// Ad(T^-1) of (rotation, translation).
Vector6d seen_from(const Pose& T, const Eigen::Vector3d& rotation,
                   const Eigen::Vector3d& translation) {
  const Eigen::Quaterniond inverse = T.rotation.conjugate();
  Vector6d out;
  out << inverse * rotation, inverse * (translation - T.translation.cross(rotation));
  return out;
}

Vector6d axis_seen_from(const Pose& T, JointType type) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  return type == JointType::kRevolute ? seen_from(T, z, zero) : seen_from(T, zero, z);
}

// Ad(T^-1) times what tilts and shifts of the axis do at one coordinate.
void fill_geometry(const Pose& T, JointType type, double value, Eigen::Index column,
                   ChainJacobian& J) {
  const Eigen::Matrix3d R = T.rotation.conjugate().toRotationMatrix();
  if (type == JointType::kPrismatic) {
    J.col(column) << Eigen::Vector3d::Zero(), -value * R.col(1);
    J.col(column + 1) << Eigen::Vector3d::Zero(), value * R.col(0);
    return;
  }
  // (Rot(-v) - 1) e_x and e_y, once as tilt and once as shift.
  const double c = std::cos(value) - 1.0;
  const double s = std::sin(value);
  const Eigen::Vector3d ex(c, -s, 0.0);
  const Eigen::Vector3d ey(s, c, 0.0);
  J.col(column) << R * ex, -(R * T.translation.cross(ex));
  J.col(column + 1) << R * ey, -(R * T.translation.cross(ey));
  J.col(column + 2) << Eigen::Vector3d::Zero(), J.col(column).head<3>();
  J.col(column + 3) << Eigen::Vector3d::Zero(), J.col(column + 1).head<3>();
}

}  // namespace

int parameter_count(const ChainModel& model) {
  int count = 6;
  for (const ChainJoint& joint : model.joints) {
    count += geometry_size(joint.type) + static_cast<int>(joint.terms.size());
  }
  return count;
}

bool is_free(const ChainModel& model) {
  return model.joints.size() == 1 && model.joints.front().terms.empty();
}

ChainKinematics::ChainKinematics(const ChainModel& model) : model_(model) {
  Pose inverse;
  for (const ChainJoint& joint : model.joints) {
    links_.push_back(inverse * joint.frame);
    inverse = joint.frame.inverse();
  }
  links_.push_back(inverse * model.mount);
  for (const Pose& link : links_) inverses_.push_back(link.inverse());
  if (!model.joints.empty()) last_axis_ = axis_seen_from(links_.back(), model.joints.back().type);
}

Pose ChainKinematics::pose(const double* coordinates) const {
  Pose out = links_.back();
  for (std::size_t k = model_.joints.size(); k-- > 0;) {
    out = compose(links_[k], moved(model_.joints[k].type, coordinates[k], out));
  }
  out.rotation.normalize();
  return out;
}

Pose ChainKinematics::left_over(const double* coordinates, const Pose& seen) const {
  Pose out = compose(inverses_.front(), seen);
  for (std::size_t k = 0; k < model_.joints.size(); ++k) {
    out = compose(inverses_[k + 1], moved(model_.joints[k].type, -coordinates[k], out));
  }
  return out;
}

void ChainKinematics::jacobian(const double* coordinates, const Eigen::MatrixXd& readings,
                               int instant, ChainJacobian& J) const {
  Eigen::Index column = J.cols() - 6;
  J.rightCols<6>().setIdentity();
  Pose tail = links_.back();  // from the joint's moved frame to the child
  for (std::size_t k = model_.joints.size(); k-- > 0;) {
    const ChainJoint& joint = model_.joints[k];
    const bool last = k + 1 == model_.joints.size();
    const auto terms = static_cast<Eigen::Index>(joint.terms.size());
    column -= geometry_size(joint.type) + terms;
    fill_geometry(tail, joint.type, coordinates[k], column, J);
    const Vector6d axis = last ? last_axis_ : axis_seen_from(tail, joint.type);
    for (Eigen::Index t = 0; t < terms; ++t) {
      const int channel = joint.terms[static_cast<std::size_t>(t)].channel;
      J.col(column + geometry_size(joint.type) + t) = readings(instant, channel) * axis;
    }
    if (k > 0) tail = compose(links_[k], moved(joint.type, coordinates[k], tail));
  }
}

Vector6d ChainKinematics::twist(const double* coordinates, const double* rates) const {
  Vector6d out = Vector6d::Zero();
  Pose tail = links_.back();
  for (std::size_t k = model_.joints.size(); k-- > 0;) {
    const JointType type = model_.joints[k].type;
    out += rates[k] * axis_seen_from(tail, type);
    if (k > 0) tail = compose(links_[k], moved(type, coordinates[k], tail));
  }
  return out;
}

}  // namespace kinescope::structure_search
