// SPDX-License-Identifier: Apache-2.0
//
// Superposition against evaluation in the gravity itself.
#include "dynamics/effects/gravity_regressors.h"

#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "tests/truth/torque_effects.h"

namespace kinescope::effects {
namespace {

constexpr double kRounding = 1e-12;  // of the largest value

struct Motions {
  RigidModel rigid;
  Eigen::MatrixXd q, dq, ddq;
};

Motions some_motion() {
  Rng rng = Rng::from_name("gravity regressors");
  EffectWorldOptions options;
  options.joints = 4;
  Motions out;
  out.rigid = make_rigid_model(effect_world({}, options, rng).model);
  for (Eigen::MatrixXd* values : {&out.q, &out.dq, &out.ddq}) {
    values->resize(20, out.rigid.size());
    for (double& value : values->reshaped()) value = rng.normal();
  }
  return out;
}

void expect_same(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
  ASSERT_EQ(one.rows(), other.rows());
  ASSERT_EQ(one.cols(), other.cols());
  EXPECT_LT((one - other).cwiseAbs().maxCoeff(), kRounding * other.cwiseAbs().maxCoeff());
}

TEST(GravityRegressors, OneEvaluationServesEveryDirection) {
  const Motions m = some_motion();
  const GravityRegressors all = make_gravity_regressors(m.rigid, m.q, m.dq, m.ddq);
  for (const Eigen::Vector3d& gravity :
       {m.rigid.gravity_m_s2, Eigen::Vector3d{9.8, 0.0, 0.0}, Eigen::Vector3d{3.0, -5.0, 7.0}}) {
    RigidModel pulled = m.rigid;
    pulled.gravity_m_s2 = gravity;
    const auto Y = regressors_of_samples(pulled, m.q, m.dq, m.ddq);
    for (std::size_t j = 0; j < Y.size(); ++j) {
      expect_same(all.regressor(j, gravity), Y[j]);
      expect_same(all.normal(j, gravity), Y[j].transpose() * Y[j]);
    }
  }
}

TEST(GravityRegressors, SlopesAreThoseOfNewtonAndEuler) {
  const Motions m = some_motion();
  const auto slopes = make_gravity_regressors(m.rigid, m.q, m.dq, m.ddq).slopes(m.rigid);
  const auto of_samples = gravity_slopes_of_samples(m.rigid, m.q);
  for (std::size_t axis = 0; axis < slopes.size(); ++axis) {
    expect_same(slopes[axis], of_samples[axis]);
    for (Eigen::Index i = 0; i < m.q.rows(); ++i) {
      const Eigen::MatrixXd one = gravity_jacobian(m.rigid, m.q.row(i).transpose());
      expect_same(of_samples[axis].row(i).transpose(), one.col(static_cast<Eigen::Index>(axis)));
    }
  }
}

}  // namespace
}  // namespace kinescope::effects
