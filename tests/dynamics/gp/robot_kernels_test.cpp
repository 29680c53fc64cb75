// SPDX-License-Identifier: Apache-2.0
//
// A turning arm with a sliding mass, in closed form, lies in the space of both robot kernels: they
// must learn it exactly from samples without noise, which a squared exponential cannot.
#include "dynamics/gp/robot_kernels.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/gp/gaussian_process.h"
#include "dynamics/gp/lip_kernel.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

const JointKinds kJoints = {JointKind::kRevolute, JointKind::kPrismatic};

// T = 1/2 (I + m r^2) dq^2 + 1/2 m dr^2, V = m g r sin q.
Eigen::RowVector2d torques(const Eigen::RowVectorXd& x) {
  constexpr double kInertia = 0.8;
  constexpr double kMass = 1.3;
  constexpr double kGravity = 9.81;
  const double q = x[0], r = x[1], dq = x[2], dr = x[3], ddq = x[4], ddr = x[5];
  return {(kInertia + kMass * r * r) * ddq + 2.0 * kMass * r * dr * dq +
              kMass * kGravity * r * std::cos(q),
          kMass * ddr - kMass * r * dq * dq + kMass * kGravity * std::sin(q)};
}

struct Arm {
  Dataset data;
  Eigen::MatrixXd unseen;
  Eigen::MatrixXd truth;
};

Arm make_arm(Eigen::Index samples) {
  Rng rng = Rng::from_name("arm");
  Arm out;
  out.data.inputs = random_matrix(rng, samples, 6);
  out.data.targets.resize(samples, 2);
  for (Eigen::Index i = 0; i < samples; ++i) {
    out.data.targets.row(i) = torques(out.data.inputs.row(i));
  }
  out.unseen = random_matrix(rng, 100, 6);
  out.truth.resize(100, 2);
  for (Eigen::Index i = 0; i < 100; ++i) out.truth.row(i) = torques(out.unseen.row(i));
  return out;
}

double relative_error(const Eigen::MatrixXd& got, const Eigen::MatrixXd& truth) {
  return (got - truth).norm() / truth.norm();
}

// Noise of 1e-4 Nm is assumed; the functions are of order 10 Nm.
constexpr double kNoise = 1e-8;
constexpr double kExact = 1e-3;

Dataset one_output(const Dataset& data, Eigen::Index output) {
  return {data.inputs, data.targets.col(output), {}, {}};
}

TEST(RobotKernels, GipLearnsEachTorqueExactly) {
  const Arm arm = make_arm(200);
  for (Eigen::Index o = 0; o < 2; ++o) {
    const Dataset data = one_output(arm.data, o);
    const GpModel model = make_model(gip(kJoints), kNoise);
    EXPECT_LT(relative_error(predict(fit(model, data), arm.unseen).mean, arm.truth.col(o)), kExact);
    const GpModel smooth = make_model(rbf(first_columns(6)), kNoise);
    EXPECT_GT(relative_error(predict(fit(smooth, data), arm.unseen).mean, arm.truth.col(o)),
              100.0 * kExact);
  }
}

TEST(RobotKernels, GipStartsAtTheData) {
  Arm arm = make_arm(150);
  arm.data.inputs.rightCols(4) *= 30.0;  // a fast robot: squared speeds of about 1000
  for (Eigen::Index i = 0; i < 150; ++i) {
    arm.data.targets.row(i) = torques(arm.data.inputs.row(i));
  }
  const Kernel unit = gip(kJoints);
  const Kernel scaled = gip(kJoints, arm.data.inputs);
  // The same function of its parameters.
  EXPECT_TRUE(covariance(unit, arm.unseen)
                  .isApprox(covariance(scaled.with_log_values(unit.log_values()), arm.unseen)));
  // "About": the mean of a product is not the product of the means.
  const double variance = covariance(scaled, arm.data.inputs).diagonal().mean();
  EXPECT_GT(variance, 1.0 / 3.0);
  EXPECT_LT(variance, 3.0);
  EXPECT_GT(covariance(unit, arm.data.inputs).diagonal().mean(), 1e4);
  for (Eigen::Index o = 0; o < 2; ++o) {
    const Dataset data = one_output(arm.data, o);
    const auto likelihood = [&](const Kernel& kernel) {
      return fit(make_model(kernel, 1e-3, standardise_targets(data)), data).log_likelihood;
    };
    EXPECT_GT(likelihood(scaled), likelihood(unit));
  }
}

TEST(RobotKernels, LipLearnsAllTorquesExactlyFromFewerSamples) {
  const Arm arm = make_arm(60);
  const GpModel model = make_model(lip(kJoints), kNoise);
  for (const Route route : {Route::kDense, Route::kFeatures}) {
    const FittedGp fitted = fit(model, arm.data, {.route = route});
    EXPECT_LT(relative_error(predict(fitted, arm.unseen).mean, arm.truth), kExact);
  }
}

// Torques of a conservative robot determine each other: from the first alone the second is known
// but for what never moves the first joint.
TEST(RobotKernels, LipCarriesKnowledgeFromOneTorqueToTheOther) {
  Arm arm = make_arm(120);
  // The second torque is measured so badly that it says nothing.
  arm.data.noise_scale = Eigen::MatrixXd::Ones(120, 2);
  arm.data.noise_scale.col(1).setConstant(1e16);
  arm.unseen.col(5).setZero();
  for (Eigen::Index i = 0; i < 100; ++i) arm.truth.row(i) = torques(arm.unseen.row(i));
  const FittedGp fitted = fit(make_model(lip(kJoints), kNoise), arm.data, {.route = Route::kDense});
  EXPECT_LT(relative_error(predict(fitted, arm.unseen).mean.col(1), arm.truth.col(1)), 0.01);
}

TEST(RobotKernels, FrictionIsLinearInItsFeatures) {
  const FeatureMap sharp = friction(1);
  const FeatureMap soft = friction(1, 0.1);
  const Eigen::RowVector2d x(5.0, -0.05);
  EXPECT_EQ(sharp(x)(0, 0), -0.05);
  EXPECT_EQ(sharp(x)(0, 1), -1.0);
  EXPECT_NEAR(soft(x)(0, 1), std::tanh(-0.5), 1e-15);
  EXPECT_EQ(friction(0)(Eigen::RowVectorXd::Zero(1))(0, 1), 0.0);
}

}  // namespace
}  // namespace kinescope::gp
