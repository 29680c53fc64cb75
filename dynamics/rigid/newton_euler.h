// SPDX-License-Identifier: Apache-2.0
//
// Recursive Newton-Euler with its memory, for many samples without allocation. Featherstone 2008,
// table 5.1.
#pragma once

#include <utility>
#include <vector>

#include "dynamics/rigid/body_motions.h"

namespace kinescope::rigid {

/// Newton and Euler for one body, about its frame's origin.
[[nodiscard]] inline BodyWrench required_wrench(const InertialParameters& inertia,
                                                const BodyMotion& motion) {
  const Eigen::Vector3d& h = inertia.first_moment_kgm;
  const Eigen::Vector3d& w = motion.omega;
  return {
      .moment = inertia.inertia_kgm2 * motion.alpha + w.cross(inertia.inertia_kgm2 * w) +
                h.cross(motion.acceleration),
      .force = inertia.mass_kg * motion.acceleration + motion.alpha.cross(h) + w.cross(w.cross(h))};
}

class NewtonEuler {
 public:
  explicit NewtonEuler(RigidModel model)
      : model_(std::move(model)), motions_(model_), wrenches_(model_.bodies.size()) {}

  /// M ddq + C dq + g, motor inertias with M. All vectors: anything with an index.
  template <typename Q, typename Dq, typename Ddq, typename Out>
  void torque(const Q& q, const Dq& dq, const Ddq& ddq, Out&& out) {
    motions_.move(q, dq, ddq);
    const std::size_t n = motions_.size();
    for (std::size_t k = 0; k < n; ++k) {
      wrenches_[k] = required_wrench(model_.bodies[k].inertia, motions_[k]);
    }
    for (std::size_t k = n; k-- > 0;) {
      const auto i = static_cast<Eigen::Index>(k);
      const BodyWrench& wrench = wrenches_[k];
      const double along = motions_.axis(k).dot(motions_.turns(k) ? wrench.moment : wrench.force);
      out[i] = along + model_.bodies[k].motor_inertia * ddq[i];
      if (motions_.parent(k) >= 0) hand_down(motions_[k], wrench, motions_.parent(k));
    }
  }

 private:
  void hand_down(const BodyMotion& motion, const BodyWrench& wrench, int parent) {
    BodyWrench& below = wrenches_[static_cast<std::size_t>(parent)];
    const Eigen::Vector3d force = motion.R_parent_body * wrench.force;
    below.force += force;
    below.moment += motion.R_parent_body * wrench.moment + motion.p_parent_body.cross(force);
  }

  RigidModel model_;
  BodyMotions motions_;
  std::vector<BodyWrench> wrenches_;
};

}  // namespace kinescope::rigid
