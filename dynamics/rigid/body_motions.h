// SPDX-License-Identifier: Apache-2.0
//
// The outward half of Newton-Euler, shared by torques and regressor: where each body is and how it
// moves, in its own frame. Made once a model, used for many samples without further allocation.
#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "dynamics/rigid/rigid_model.h"

namespace kinescope::rigid {

/// A body's motion at one sample, expressed in its own frame.
struct BodyMotion {
  Eigen::Matrix3d R_parent_body;
  Eigen::Vector3d p_parent_body;
  Eigen::Vector3d omega;         ///< angular velocity, rad/s
  Eigen::Vector3d alpha;         ///< angular acceleration, rad/s^2
  Eigen::Vector3d acceleration;  ///< of the frame's origin minus gravity, m/s^2
};

/// A wrench on a body about its frame's origin, in its frame.
struct BodyWrench {
  Eigen::Vector3d moment;
  Eigen::Vector3d force;
};

class BodyMotions {
 public:
  explicit BodyMotions(const RigidModel& model) : motions_(model.bodies.size()) {
    joints_.reserve(model.bodies.size());
    for (const RigidBody& body : model.bodies) joints_.emplace_back(body);
    ground_acceleration_ = -model.gravity_m_s2;
  }

  [[nodiscard]] std::size_t size() const { return joints_.size(); }
  [[nodiscard]] int parent(std::size_t body) const { return joints_[body].parent; }
  [[nodiscard]] bool turns(std::size_t body) const { return joints_[body].turns; }
  [[nodiscard]] const Eigen::Vector3d& axis(std::size_t body) const { return joints_[body].axis; }
  [[nodiscard]] const BodyMotion& operator[](std::size_t body) const { return motions_[body]; }

  /// q, dq and ddq: anything with an index.
  template <typename Vector>
  void move(const Vector& q, const Vector& dq, const Vector& ddq) {
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      place(joints_[k], q[i], motions_[k]);
      accelerate(joints_[k], dq[i], ddq[i], motions_[k]);
    }
  }

 private:
  /// Rodrigues: R(q) = constant + sin(q) sine + cos(q) cosine.
  struct JointMap {
    explicit JointMap(const RigidBody& body)
        : turns(body.type == JointType::kRevolute),
          parent(body.parent),
          axis(body.axis),
          origin(body.p_parent_joint),
          direction(body.R_parent_joint * body.axis) {
      constant = turns ? direction * axis.transpose() : body.R_parent_joint;
      sine = body.R_parent_joint * skew(axis);
      cosine = body.R_parent_joint - constant;
    }
    bool turns;
    int parent;
    Eigen::Vector3d axis;
    Eigen::Vector3d origin;
    Eigen::Vector3d direction;  ///< axis in the parent's frame
    Eigen::Matrix3d constant;
    Eigen::Matrix3d sine;
    Eigen::Matrix3d cosine;
  };

  static void place(const JointMap& joint, double q, BodyMotion& body) {
    if (joint.turns) {
      body.R_parent_body = joint.constant + std::sin(q) * joint.sine + std::cos(q) * joint.cosine;
      body.p_parent_body = joint.origin;
    } else {
      body.R_parent_body = joint.constant;
      body.p_parent_body = joint.origin + q * joint.direction;
    }
  }

  /// Craig 2005, eq. 6.45 to 6.48, for classical accelerations.
  void accelerate(const JointMap& joint, double dq, double ddq, BodyMotion& body) const {
    const auto R_body_parent = body.R_parent_body.transpose();
    if (joint.parent < 0) {
      body.omega.setZero();
      body.alpha.setZero();
      body.acceleration.noalias() = R_body_parent * ground_acceleration_;
    } else {
      const BodyMotion& parent = motions_[static_cast<std::size_t>(joint.parent)];
      const Eigen::Vector3d& p = body.p_parent_body;
      const Eigen::Vector3d at_joint =
          parent.acceleration + parent.alpha.cross(p) + parent.omega.cross(parent.omega.cross(p));
      body.omega.noalias() = R_body_parent * parent.omega;
      body.alpha.noalias() = R_body_parent * parent.alpha;
      body.acceleration.noalias() = R_body_parent * at_joint;
    }
    const Eigen::Vector3d rate = dq * joint.axis;
    if (joint.turns) {
      body.alpha += ddq * joint.axis + body.omega.cross(rate);
      body.omega += rate;
    } else {
      body.acceleration += ddq * joint.axis + 2.0 * body.omega.cross(rate);
    }
  }

  std::vector<JointMap> joints_;
  std::vector<BodyMotion> motions_;
  Eigen::Vector3d ground_acceleration_;
};

}  // namespace kinescope::rigid
