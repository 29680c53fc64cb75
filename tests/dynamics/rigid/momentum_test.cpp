// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/momentum.h"

#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

/// Sums of about a hundred products each.
constexpr double kMomentumRounding = 1e-11;

TEST(Momentum, IsWhatTheMatricesSay) {
  Rng rng = Rng::from_name("momentum");
  for (const bool tree : {false, true}) {
    for (int joints = 1; joints <= 8; ++joints) {
      const KinematicTree robot = random_robot({.joints = joints, .tree = tree}, rng).tree;
      const RigidModel model = make_rigid_model(random_masses(robot, {}, rng));
      MomentumRecursion recursion(model);
      const RandomStates states = random_states(robot, 5, rng);
      for (int t = 0; t < 5; ++t) {
        const Eigen::VectorXd q = states.q.row(t);
        const Eigen::VectorXd dq = states.dq.row(t);
        const MomentumTerms& terms = recursion.evaluate(q, dq);
        const Eigen::MatrixXd M = mass_matrix(model, q);
        const double scale = 1.0 + M.norm();
        EXPECT_LT((terms.mass - M).norm(), kMomentumRounding * scale);
        EXPECT_LT((terms.momentum - M * dq).norm(), kMomentumRounding * scale);
        EXPECT_LT((terms.velocity_torque - coriolis_matrix(model, q, dq).transpose() * dq).norm(),
                  kMomentumRounding * scale * (1.0 + dq.squaredNorm()));
        EXPECT_LT((terms.gravity_torque - gravity_torque(model, q)).norm(),
                  kMomentumRounding * 10 * scale);
      }
    }
  }
}

}  // namespace
}  // namespace kinescope
