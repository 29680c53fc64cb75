// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/identify.h"

#include <numbers>

#include <gtest/gtest.h>

#include "dynamics/identify/prediction.h"
#include "kinematics/core/error.h"
#include "tests/dynamics/identify/random_arm.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

/// The true value of every parameter of a fit.
Eigen::VectorXd true_parameters(const DynamicModel& model, const Identification& fit,
                                const Eigen::VectorXd& offsets = {}) {
  const RigidModel rigid = make_rigid_model(model);
  const std::vector<JointId> joints = moving_joints(model.tree);
  Eigen::VectorXd terms = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(fit.terms.size()));
  terms.head(10 * rigid.size()) = body_parameters(rigid);
  for (std::size_t k = 0; k < fit.terms.size(); ++k) {
    const TorqueTerm& term = fit.terms[k];
    if (term.kind == TermKind::kInertial || term.kind > TermKind::kOffset) continue;
    const JointDynamics& joint = model.joints[joints[static_cast<std::size_t>(term.index)].index()];
    double& value = terms[static_cast<Eigen::Index>(k)];
    if (term.kind == TermKind::kMotorInertia) value = joint.motor_inertia;
    if (term.kind == TermKind::kViscous) value = joint.viscous;
    if (term.kind == TermKind::kCoulomb) value = joint.coulomb;
    if (term.kind == TermKind::kOffset && offsets.size() > 0) value = offsets[term.index];
  }
  return fit.basis.regroup * terms;
}

/// Largest error in units of the parameter's own sigma.
double largest_ratio(const Identification& fit, const Eigen::VectorXd& truth) {
  return ((fit.parameters - truth).array() / fit.covariance.diagonal().array().sqrt())
      .abs()
      .maxCoeff();
}

// Normal equations of columns of condition up to some thousand keep eight digits; in torque, ten.
constexpr double kNoiseFree = 1e-7;

TEST(Identify, WithoutNoiseItIsTheRobot) {
  Rng rng = Rng::from_name("Identify.WithoutNoiseItIsTheRobot");
  for (int robot = 0; robot < 5; ++robot) {
    const DynamicModel model = random_arm(3 + rng.index(4), rng, 0.3);
    const Eigen::Index n = make_rigid_model(model).size();
    TorqueWorldOptions world{.noise = 0.0};
    world.offsets = Eigen::VectorXd::LinSpaced(n, -1.0, 1.0);
    const TorqueSamples log = torque_log_of(model, world, rng);
    const Identification fit =
        identify_dynamics(without_masses(model.tree), log, {.loss = RobustLoss::kNone});
    EXPECT_EQ(fit.status, IdentifyStatus::kConverged);
    DynamicModel geometry = without_masses(model.tree);
    geometry.gravity_m_s2 = model.gravity_m_s2;
    const Identification right = identify_dynamics(geometry, log, {.loss = RobustLoss::kNone});
    const Eigen::VectorXd truth = true_parameters(model, right, world.offsets);
    EXPECT_LT((right.parameters - truth).norm(), kNoiseFree * truth.norm());
    EXPECT_LT(right.fit_error_percent.maxCoeff(), 1e-12);
    // With gravity pointing elsewhere it is not.
    EXPECT_GT(fit.fit_error_percent.maxCoeff(), 1e-3);
  }
}

/// Three upright parallel axes; the second one is turned by two right angles as they are written.
DynamicModel upright_arm(double right_angle_rad) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (int k = 0; k < 3; ++k) {
    Joint joint;
    joint.name = "joint" + std::to_string(k + 1);
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{k};
    joint.child = LinkId{k + 1};
    joint.T_parent_joint.translation = {0.3 * k, 0.0, 0.1};
    tree.joints.push_back(joint);
    tree.links.push_back({"link" + std::to_string(k + 1)});
  }
  const Eigen::Quaterniond turn = exp_rotation(Eigen::Vector3d::UnitX() * right_angle_rad);
  tree.joints[1].T_parent_joint.rotation = turn * turn;
  return without_masses(tree);
}

TEST(Identify, ARightAngleOfFiveDigitsHasNoParametersOfItsOwn) {
  const auto parameters = [](double right_angle_rad) {
    const RigidModel rigid = make_rigid_model(upright_arm(right_angle_rad));
    return independent_terms(rigid, {}, torque_terms(rigid, {}));
  };
  const ColumnBasis exact = parameters(0.5 * std::numbers::pi);
  for (const double written : {1.5708, 1.570796, 1.570796327}) {
    const ColumnBasis rounded = parameters(written);
    EXPECT_EQ(rounded.kept, exact.kept) << written;
    EXPECT_EQ(rounded.without_effect, exact.without_effect) << written;
  }
  EXPECT_GT(parameters(1.56).kept.size(), exact.kept.size());
}

TEST(Identify, NoiseOfEachJointIsFound) {
  Rng rng = Rng::from_name("Identify.NoiseOfEachJointIsFound");
  const DynamicModel model = random_arm(5, rng);
  const TorqueSamples log = torque_log_of(model, {.samples = 4000, .noise = 0.02}, rng);
  Rng again = Rng::from_name("Identify.NoiseOfEachJointIsFound");
  const DynamicModel same = random_arm(5, again);
  const TorqueSamples clean = torque_log_of(same, {.samples = 4000, .noise = 0.0}, again);
  for (const RobustLoss loss :
       {RobustLoss::kNone, RobustLoss::kHuber, RobustLoss::kTukey, RobustLoss::kStudent}) {
    const Identification fit = identify_dynamics(model, log, {.loss = loss});
    for (Eigen::Index j = 0; j < 5; ++j) {
      const double truth = 0.02 * clean.torque.col(j).norm() / std::sqrt(4000.0);
      // Four sigma of a median of 4000 are 7 %; Student's scale is as good.
      EXPECT_NEAR(fit.sigma[j] / truth, 1.0, 0.07) << static_cast<int>(loss) << " " << j;
    }
    EXPECT_LT(largest_ratio(fit, true_parameters(model, fit)), 5.0) << static_cast<int>(loss);
  }
}

TEST(Identify, OutliersAreDownWeighted) {
  Rng rng = Rng::from_name("Identify.OutliersAreDownWeighted");
  const DynamicModel model = random_arm(4, rng);
  const TorqueSamples log =
      torque_log_of(model, {.samples = 3000, .noise = 0.01, .outliers = 0.05}, rng);
  const auto error = [&](RobustLoss loss) {
    const Identification fit = identify_dynamics(model, log, {.loss = loss});
    if (loss != RobustLoss::kNone) {
      // Nearly all of the 5 % thrown off, and 0.7 % (Huber) to 3 % of the good ones.
      EXPECT_GT(fit.down_weighted.minCoeff(), 0.04);
      EXPECT_LT(fit.down_weighted.maxCoeff(), 0.12);
    } else {
      EXPECT_EQ(fit.down_weighted.maxCoeff(), 0.0);
    }
    return (fit.parameters - true_parameters(model, fit)).norm();
  };
  const double plain = error(RobustLoss::kNone);
  EXPECT_LT(error(RobustLoss::kHuber), 0.3 * plain);
  EXPECT_LT(error(RobustLoss::kTukey), 0.2 * plain);
  EXPECT_LT(error(RobustLoss::kStudent), 0.3 * plain);
}

TEST(Identify, WeightZeroLeavesOut) {
  Rng rng = Rng::from_name("Identify.WeightZeroLeavesOut");
  const DynamicModel model = random_arm(3, rng);
  TorqueSamples log = torque_log_of(model, {.noise = 0.0}, rng);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(log.torque.rows(), 3);
  for (Eigen::Index t = 100; t < 300; ++t) {
    log.torque(t, 1) = std::nan("");
    weights(t, 1) = 0.0;
  }
  log.q(700, 0) = std::nan("");
  weights.row(700).setZero();
  const Identification fit = identify_dynamics(model, log, {.loss = RobustLoss::kNone}, weights);
  const Eigen::VectorXd truth = true_parameters(model, fit);
  EXPECT_LT((fit.parameters - truth).norm(), kNoiseFree * truth.norm());
  EXPECT_EQ(fit.used[0], 1999);
  EXPECT_EQ(fit.used[1], 1799);
}

TEST(Identify, GainsOfCurrentsAreFound) {
  Rng rng = Rng::from_name("Identify.GainsOfCurrentsAreFound");
  const DynamicModel model = random_arm(4, rng);
  TorqueSamples log = torque_log_of(model, {.samples = 4000, .noise = 0.002}, rng);
  const Eigen::Vector4d truth(1.0, 0.8, 1.3, 0.6);
  log.torque = log.torque * truth.asDiagonal();
  const Identification fit = identify_dynamics(model, log, {.gains = true, .gain_reference = 0});
  for (Eigen::Index j = 1; j < 4; ++j) {
    EXPECT_NEAR(fit.gains[j], truth[j], 4.0 * fit.gain_sigma[j]) << j;
    EXPECT_LT(fit.gain_sigma[j], 0.01);
  }
  EXPECT_EQ(fit.gain_sigma[0], 0.0);
  const TorquePrediction prediction = predict_torque(fit, log.q, log.dq, log.ddq);
  EXPECT_LT(normalised_error_percent(log.torque, prediction.mean).maxCoeff(), 0.01);
}

TEST(Identify, OutliersDoNotBendTheGains) {
  Rng rng = Rng::from_name("Identify.OutliersDoNotBendTheGains");
  const DynamicModel model = random_arm(3, rng);
  TorqueSamples log = torque_log_of(model, {.samples = 1500, .noise = 0.002}, rng);
  const Eigen::Vector3d truth(1.0, 0.8, 1.3);
  log.torque = log.torque * truth.asDiagonal();
  const Eigen::MatrixXd clean = log.torque;
  // Something pushes two joints, always the same way.
  for (Eigen::Index t = 0; t < log.size(); ++t) {
    if (t % 100 >= 12) continue;
    for (const Eigen::Index j : {1, 2}) log.torque(t, j) += 2.0 * clean.col(j).cwiseAbs().mean();
  }
  const Identification fit = identify_dynamics(model, log, {.gains = true, .gain_reference = 0});
  EXPECT_LT((fit.gains - truth).cwiseAbs().maxCoeff(), 0.02);
  const TorquePrediction prediction = predict_torque(fit, log.q, log.dq, log.ddq);
  EXPECT_LT(normalised_error_percent(clean, prediction.mean).maxCoeff(), 0.1);
}

TEST(Identify, CoupledDrivesAreFound) {
  Rng rng = Rng::from_name("Identify.CoupledDrivesAreFound");
  const DynamicModel model = random_arm(4, rng);
  TorqueSamples log = torque_log_of(model, {.noise = 0.0}, rng);
  const Eigen::VectorXd rate = log.dq.col(2) + log.dq.col(3);
  const Eigen::VectorXd torque = 0.2 * (log.ddq.col(2) + log.ddq.col(3)) + 0.7 * rate +
                                 1.1 * (rate.array() / 0.01).tanh().matrix();
  log.torque.col(2) += torque;
  log.torque.col(3) += torque;
  IdentifyOptions options{.loss = RobustLoss::kNone};
  EXPECT_GT(identify_dynamics(model, log, options).fit_error_percent.maxCoeff(), 1e-3);
  options.drives.coupled_drives = {Eigen::Vector4d(0, 0, 1, 1)};
  const Identification fit = identify_dynamics(model, log, options);
  EXPECT_LT(fit.fit_error_percent.maxCoeff(), 1e-12);
  const auto p = fit.parameters.size();
  EXPECT_EQ(fit.names[static_cast<std::size_t>(p - 1)], "coulomb(coupled1)");
  EXPECT_NEAR(fit.parameters[p - 1], 1.1, 1e-7);
}

TEST(Identify, AJointAtRestIsSaidSo) {
  Rng rng = Rng::from_name("Identify.AJointAtRestIsSaidSo");
  const DynamicModel model = random_arm(3, rng);
  TorqueSamples log = torque_log_of(model, {.noise = 0.0}, rng);
  for (Eigen::MatrixXd* m : {&log.q, &log.dq, &log.ddq}) m->col(2).setZero();
  const Identification fit = identify_dynamics(model, log, {});
  std::vector<std::string> names;
  for (const int k : fit.undetermined) names.push_back(fit.names[static_cast<std::size_t>(k)]);
  EXPECT_NE(std::ranges::find(names, "viscous(" + model.tree.joints[2].name + ")"), names.end());
  // Once it moves, nobody knows the torque.
  Eigen::MatrixXd dq = log.dq.topRows(5);
  dq.col(2).setOnes();
  const TorquePrediction prediction = predict_torque(fit, log.q.topRows(5), dq, log.ddq.topRows(5));
  EXPECT_TRUE(std::isinf(prediction.sigma(3, 2)));
}

TEST(Identify, RoundingIsNoMotion) {
  Rng rng = Rng::from_name("Identify.RoundingIsNoMotion");
  const DynamicModel model = random_arm(3, rng);
  TorqueSamples log = torque_log_of(model, {.noise = 0.01}, rng);
  constexpr double kRounding = 1e-12;
  for (Eigen::MatrixXd* m : {&log.q, &log.dq, &log.ddq}) {
    for (double& value : m->col(2)) value = kRounding * rng.normal();
  }
  const Identification fit = identify_dynamics(model, log, {});
  std::vector<std::string> names;
  for (const int k : fit.undetermined) names.push_back(fit.names[static_cast<std::size_t>(k)]);
  for (const char* term : {"viscous(", "coulomb("}) {
    EXPECT_NE(std::ranges::find(names, term + model.tree.joints[2].name + ")"), names.end());
  }
  for (const int k : fit.undetermined) EXPECT_LT(std::abs(fit.parameters[k]), 1e3);
  // At rest the torque is known all the same; in motion it is not.
  TorquePrediction prediction = predict_torque(fit, log.q, log.dq, log.ddq);
  EXPECT_TRUE(prediction.sigma.allFinite());
  log.dq.col(2).setOnes();
  prediction = predict_torque(fit, log.q, log.dq, log.ddq);
  EXPECT_TRUE(std::isinf(prediction.sigma(3, 2)));
  EXPECT_LT(prediction.mean.cwiseAbs().maxCoeff(), 1e6);
}

TEST(Identify, RefusesWhatCannotWork) {
  Rng rng = Rng::from_name("Identify.RefusesWhatCannotWork");
  const DynamicModel model = random_arm(3, rng);
  const TorqueSamples log = torque_log_of(model, {}, rng);
  TorqueSamples bad = log;
  bad.ddq = bad.ddq.leftCols(2).eval();
  EXPECT_THROW(static_cast<void>(identify_dynamics(model, bad)), Error);
  bad = log;
  bad.torque(7, 1) = std::nan("");
  EXPECT_THROW(static_cast<void>(identify_dynamics(model, bad)), Error);
  EXPECT_THROW(
      static_cast<void>(identify_dynamics(model, torque_log_of(model, {.samples = 15}, rng))),
      Error);
  IdentifyOptions options;
  options.drives.coulomb_width_rad_s = std::nan("");
  EXPECT_THROW(static_cast<void>(identify_dynamics(model, log, options)), Error);
  options = {};
  options.drives.coupled_drives = {Eigen::Vector2d(1, 1)};
  EXPECT_THROW(static_cast<void>(identify_dynamics(model, log, options)), Error);
}

TEST(NormalisedError, AConstantChannelHasNone) {
  Eigen::MatrixXd measured(4, 2);
  measured << 1, 0.3, 2, 0.3, 3, 0.3 + 1e-15, 4, 0.3;
  const Eigen::MatrixXd predicted = measured.array() + 0.5;
  const Eigen::VectorXd error = normalised_error_percent(measured, predicted);
  EXPECT_TRUE(std::isfinite(error[0]));
  EXPECT_TRUE(std::isnan(error[1]));
}

TEST(NormalisedError, ByHand) {
  Eigen::MatrixXd measured(4, 1);
  measured << 1, 2, 3, 4;
  Eigen::MatrixXd predicted = measured.array() + 0.5;
  EXPECT_NEAR(normalised_error_percent(measured, predicted)[0], 100.0 * 1.0 / 5.0, 1e-12);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(4, 1);
  weights(3) = 0.0;
  predicted(3) = 99.0;
  EXPECT_NEAR(normalised_error_percent(measured, predicted, weights)[0], 100.0 * 0.75 / 2.0, 1e-12);
}

}  // namespace
}  // namespace kinescope
