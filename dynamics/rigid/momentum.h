// SPDX-License-Identifier: Apache-2.0
//
// The generalised momentum p = M(q) dq and what changes it beside the actuators,
// dp/dt = torque + C'(q, dq) dq - g(q), without an acceleration. De Luca and Mattone 2003.
#pragma once

#include <vector>

#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// Of one sample; vectors have one entry a movable joint.
struct MomentumTerms {
  Eigen::MatrixXd mass;             ///< M(q), motor inertias on the diagonal
  Eigen::VectorXd momentum;         ///< M(q) dq
  Eigen::VectorXd velocity_torque;  ///< C'(q, dq) dq, the gradient of the kinetic energy in q
  Eigen::VectorXd gravity_torque;   ///< g(q)
};

/// Keeps its memory from sample to sample: no allocation after construction, O(bodies x depth).
class MomentumRecursion {
 public:
  explicit MomentumRecursion(RigidModel model);

  [[nodiscard]] const RigidModel& model() const { return model_; }

  /// The reference is good until the next call. Sizes must fit (asserted).
  const MomentumTerms& evaluate(const Eigen::Ref<const Eigen::VectorXd>& q,
                                const Eigen::Ref<const Eigen::VectorXd>& dq);

 private:
  /// A body and all that it carries, in the base frame's axes and about its origin.
  struct Carried {
    Eigen::Matrix3d R_base_body;
    Eigen::Vector3d p_base_body;
    Eigen::Vector3d axis_rotation, axis_translation;    ///< the joint's unit twist
    Eigen::Vector3d rotation, translation;              ///< the body's twist
    double mass = 0.0;                                  ///< with what it carries
    Eigen::Vector3d first_moment;                       ///< with what it carries
    Eigen::Matrix3d inertia;                            ///< with what it carries
    Eigen::Vector3d angular_momentum, linear_momentum;  ///< with what it carries
  };

  void place(std::size_t body, double q, double dq);
  void weigh(std::size_t body);
  void gather(std::size_t body);

  RigidModel model_;
  std::vector<Carried> carried_;
  MomentumTerms terms_;
};

}  // namespace kinescope
