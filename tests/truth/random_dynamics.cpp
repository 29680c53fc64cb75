// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/random_dynamics.h"

#include <cmath>
#include <numbers>

namespace kinescope {

InertialParameters random_inertia(const RandomMassOptions& options, Rng& rng) {
  constexpr int kParticles = 8;
  const double mass = options.mass_kg * std::pow(3.0, rng.uniform(-1.0, 1.0)) / kParticles;
  const Eigen::Vector3d centre = rng.normal3(options.size_m);
  Eigen::Matrix4d pseudo = Eigen::Matrix4d::Zero();
  for (int k = 0; k < kParticles; ++k) {
    const Eigen::Vector3d at = centre + rng.normal3(options.size_m);
    pseudo += mass * at.homogeneous() * at.homogeneous().transpose();
  }
  return from_pseudo_inertia(pseudo);
}

DynamicModel random_masses(const KinematicTree& tree, const RandomMassOptions& options, Rng& rng) {
  DynamicModel model = without_masses(tree);
  for (InertialParameters& link : model.links) link = random_inertia(options, rng);
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    if (tree.joints[j].type == JointType::kFixed || !options.motors) continue;
    model.joints[j] = {.viscous = rng.uniform(0.1, 2.0),
                       .coulomb = rng.uniform(0.1, 2.0),
                       .motor_inertia = rng.uniform(0.01, 0.3)};
  }
  if (options.every_direction) model.gravity_m_s2 = kUsualGravity_m_s2 * rng.unit3();
  return model;
}

RandomStates random_states(const KinematicTree& tree, int samples, Rng& rng) {
  const std::vector<JointId> joints = moving_joints(tree);
  const auto n = static_cast<Eigen::Index>(joints.size());
  RandomStates out{.q = Eigen::MatrixXd(samples, n),
                   .dq = Eigen::MatrixXd(samples, n),
                   .ddq = Eigen::MatrixXd(samples, n)};
  for (int t = 0; t < samples; ++t) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const JointType type = tree.joints[joints[static_cast<std::size_t>(j)].index()].type;
      const double reach = type == JointType::kRevolute ? std::numbers::pi : 0.5;
      out.q(t, j) = rng.uniform(-reach, reach);
      out.dq(t, j) = rng.normal();
      out.ddq(t, j) = rng.normal(3.0);
    }
  }
  return out;
}

}  // namespace kinescope
