// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/controller.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "dynamics/control/velocity_estimator.h"
#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "dynamics/simulation/simulation.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::VectorXd one(double value) { return Eigen::VectorXd::Constant(1, value); }

TEST(VelocityEstimator, LagsASineByHalfAPeriodAndTheFiltersTime) {
  constexpr double kRate_hz = 1000.0;
  constexpr double kCutoff_hz = 40.0;
  constexpr double kSine_rad_s = 3.0;
  VelocityEstimator velocity(one(0.0), one(kSine_rad_s), kRate_hz, kCutoff_hz);
  const double late_s = 1.0 / (2.0 * std::numbers::pi * kCutoff_hz);
  double worst = 0.0;
  for (int k = 1; k < 4000; ++k) {
    const double t_s = k / kRate_hz;
    const double dq = velocity.update(one(std::sin(kSine_rad_s * t_s)))[0];
    if (k > 200) {
      worst = std::max(worst, std::abs(dq - kSine_rad_s * std::cos(kSine_rad_s * (t_s - late_s))));
    }
  }
  // The filter's discrete lag is shorter than 1 / (2 pi cut-off) by half a period, which the
  // difference adds; what is left is of second order in late_s.
  EXPECT_LT(worst, 1e-3 * kSine_rad_s);
}

TEST(TorqueLimiter, KeepsLimitsAndSendsNumbersOnly) {
  TorqueLimiter limiter({.largest = one(2.0), .rate_per_s = one(100.0)}, 1, 1e-3);
  EXPECT_EQ(limiter.apply(one(5.0))[0], 2.0);  // holding a robot is not held up
  EXPECT_DOUBLE_EQ(limiter.apply(one(-5.0))[0], 1.9);
  EXPECT_DOUBLE_EQ(limiter.apply(one(kNone))[0], 1.9);
  EXPECT_DOUBLE_EQ(limiter.apply(one(kInfinity))[0], 1.9);
  EXPECT_DOUBLE_EQ(limiter.apply(one(1.85))[0], 1.85);
  EXPECT_EQ(limiter.limited()[0], 2);
  EXPECT_EQ(limiter.replaced()[0], 2);
  EXPECT_EQ(TorqueLimiter({}, 1, 1e-3).apply(one(kNone))[0], 0.0);
}

TEST(Weight, IsThatOfTheLeastMeanSquareError) {
  EXPECT_EQ(weight_of_doubt(0.0, 0.2), 1.0);
  EXPECT_DOUBLE_EQ(weight_of_doubt(0.2, 0.2), 0.5);
  EXPECT_EQ(weight_of_doubt(kInfinity, 0.2), 0.0);
  EXPECT_EQ(weight_of_doubt(kNone, 0.2), 0.0);
  EXPECT_EQ(weight_of_doubt(0.4, 0.0), 0.0);
  // Of two estimates with independent errors, no other mixture errs less.
  const auto mean_square = [](double weight) {
    return std::pow(weight * 0.3, 2) + std::pow((1.0 - weight) * 0.7, 2);
  };
  const double best = weight_of_doubt(0.3, 0.7);
  EXPECT_LT(mean_square(best), mean_square(best - 0.01));
  EXPECT_LT(mean_square(best), mean_square(best + 0.01));
}

TEST(Laws, HaveNames) {
  for (const ControlLaw law : all_control_laws()) EXPECT_EQ(control_law(to_string(law)), law);
  EXPECT_FALSE(control_law("pid").has_value());
}

/// An arm, and its controller in a loop of its own.
class Loop {
 public:
  explicit Loop(ControlLaw law) {
    for (const JointId id : moving_joints(arm_.tree)) arm_.joints[id.index()].motor_inertia = 0.2;
    const CorrectedTorqueModel model = with_effects(arm_);
    plant_ = make_plant(model);
    options_ = {.law = law, .gains = {}, .bandwidth_hz = kBandwidth_hz, .rate_hz = kRate_hz};
    options_.gains = servo_gains(mass_matrix(plant_.rigid, posture()), kBandwidth_hz);
  }
  [[nodiscard]] static Eigen::VectorXd posture() {
    return (Eigen::VectorXd(7) << 0.1, 0.4, -0.3, -1.6, 0.2, 1.7, 0.5).finished();
  }
  /// Error of the joints over time after a start off the reference, at rest.
  [[nodiscard]] std::vector<Eigen::VectorXd> errors(const Eigen::VectorXd& start, int periods) {
    Controller controller({.nominal = plant_.rigid}, options_);
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(7);
    Simulation simulation(plant_, PlantState::at(plant_, posture() + start, zero));
    std::vector<Eigen::VectorXd> out;
    for (int k = 0; k < periods; ++k) {
      const PlantState& state = simulation.state();
      out.push_back(state.q - posture());
      const Eigen::VectorXd torque = controller.command({k / kRate_hz, posture(), zero, zero},
                                                        {state.q, state.dq, posture(), zero});
      (void)simulation.step(torque, 1.0 / kRate_hz);
    }
    return out;
  }

  static constexpr double kRate_hz = 4000.0;
  static constexpr double kBandwidth_hz = 2.0;
  DynamicModel arm_ = panda_arm();
  Plant plant_;
  ControllerOptions options_;
};

TEST(ComputedTorque, ErrorsDieAsThoseOfSevenOscillatorsApart) {
  const Eigen::VectorXd start =
      (Eigen::VectorXd(7) << 0.3, -0.2, 0.25, 0.3, -0.4, 0.2, 0.5).finished();
  const std::vector<Eigen::VectorXd> errors = Loop(ControlLaw::kComputedTorque).errors(start, 3000);
  const double w = 2.0 * std::numbers::pi * Loop::kBandwidth_hz;
  // A torque held over a period acts half a period late: first order in the period.
  const double held = 0.5 / Loop::kRate_hz * w;
  for (std::size_t k = 0; k < errors.size(); k += 50) {
    const double t_s = static_cast<double>(k) / Loop::kRate_hz;
    const Eigen::VectorXd expected = start * (1.0 + w * t_s) * std::exp(-w * t_s);
    ASSERT_LT((errors[k] - expected).lpNorm<Eigen::Infinity>(),
              4.0 * held * start.lpNorm<Eigen::Infinity>())
        << t_s << " s";
  }
}

TEST(PdGravity, HoldsWhereThePlainLawSags) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(7);
  EXPECT_LT(Loop(ControlLaw::kPdGravity).errors(zero, 8000).back().lpNorm<Eigen::Infinity>(), 1e-9);
  Loop plain(ControlLaw::kPd);
  const Eigen::VectorXd sag = plain.errors(zero, 16000).back();
  // In balance the springs of the loop carry the arm where it has come to.
  const Eigen::VectorXd gravity = gravity_torque(plain.plant_.rigid, Loop::posture() + sag);
  // Settled to 0.01 of some 30 N m.
  EXPECT_GT(sag.lpNorm<Eigen::Infinity>(), 0.01);
  EXPECT_LT((plain.options_.gains.kp.cwiseProduct(sag) + gravity).lpNorm<Eigen::Infinity>(), 0.01);
}

TEST(Controller, ReadingsThatAreNoNumbersNeverReachTheMotors) {
  for (const ControlLaw law : all_control_laws()) {
    Loop loop(law);
    Controller controller({.nominal = loop.plant_.rigid}, loop.options_);
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(7);
    const MotionPoint still{0.0, Loop::posture(), zero, zero};
    Measured measured{Loop::posture(), zero, Loop::posture(), zero};
    const Eigen::VectorXd before = controller.command(still, measured);
    measured.q[2] = kNone;
    measured.dq[4] = kInfinity;
    EXPECT_EQ(controller.command(still, measured), before) << to_string(law);
  }
}

/// A model of one kind of a two-link arm, learned within a part of its range.
SavedTorqueModel learned(TorqueModelKind kind, const DynamicModel& arm, TorqueSamples& log) {
  Rng rng = Rng::from_name("Compensation.log");
  log = sinusoid_log(arm, {.samples = 400, .rate_hz = 20.0, .range_share = 0.3}, rng);
  for (Eigen::Index j = 0; j < log.joints(); ++j) log.torque.col(j) *= 1.3;  // not as declared
  TorqueModelOptions options;
  options.samples = 200;
  options.hyperparameter_samples = 100;
  options.starts = 1;
  options.inducing_points = 60;
  options.keep_saved = true;
  return *fit_torque_model(kind, arm, log, options).saved;
}

TEST(Compensation, KeepsToTheNominalMassesWhereTheModelDoesNotKnow) {
  const DynamicModel arm = scara_arm();
  TorqueSamples log;
  const auto model = learned(TorqueModelKind::kRbf, arm, log);
  const RigidModel nominal = make_rigid_model(arm);
  Compensation compensation(
      {.nominal = nominal,
       .learned = std::make_shared<const LearnedTorque>(LearnedTorque{.model = model})});
  Eigen::VectorXd known = Eigen::VectorXd::Zero(4);
  for (Eigen::Index i = 0; i < log.size(); i += 10) {
    (void)compensation.at({0.0, log.q.row(i), log.dq.row(i), log.ddq.row(i)});
    known += 10.0 / static_cast<double>(log.size()) * compensation.weight();
  }
  EXPECT_GT(known.minCoeff(), 0.9);
  const MotionPoint far{0.0, 3.0 * log.q.row(0).transpose(), 5.0 * log.dq.row(0).transpose(),
                        40.0 * log.ddq.row(0).transpose()};
  const Eigen::VectorXd torque = compensation.at(far);
  const Eigen::VectorXd weight = compensation.weight();
  const Eigen::VectorXd of_nominal = inverse_dynamics(nominal, far.q, far.dq, far.ddq);
  TorquePredictor predictor(model);
  const Eigen::VectorXd mean = predictor.mean(far.q, far.dq, far.ddq);
  EXPECT_LT(weight.minCoeff(), 0.3);
  for (Eigen::Index j = 0; j < 4; ++j) {
    EXPECT_NEAR(torque[j], of_nominal[j] + weight[j] * (mean[j] - of_nominal[j]), 1e-9);
  }
}

TEST(Compensation, APayloadIsAHeavierLastBody) {
  const RigidModel arm = make_rigid_model(panda_arm());
  const InertialParameters load =
      from_central({1.2, {0.02, -0.01, 0.1}, 0.01 * Eigen::Matrix3d::Identity()});
  RigidModel loaded = arm;
  loaded.bodies.back().inertia += load;
  Compensation compensation({.nominal = arm, .learned = {}, .payload = load});
  const Eigen::VectorXd q = Loop::posture();
  const Eigen::VectorXd torque = compensation.at({0.0, q, 0.7 * q, -2.0 * q});
  EXPECT_LT((torque - inverse_dynamics(loaded, q, 0.7 * q, -2.0 * q)).norm(), 1e-10);
}

TEST(Compensation, RefusesWhatIsOfAnotherRobotOrIsNoTorque) {
  const DynamicModel arm = scara_arm();
  TorqueSamples log;
  SavedTorqueModel model = learned(TorqueModelKind::kParametric, arm, log);
  const auto with = [&](const SavedTorqueModel& one) {
    return std::make_shared<const LearnedTorque>(LearnedTorque{.model = one});
  };
  EXPECT_THROW(Compensation({.nominal = make_rigid_model(panda_arm()), .learned = with(model)}),
               Error);
  model.torque_unit = "A";
  EXPECT_THROW(Compensation({.nominal = make_rigid_model(arm), .learned = with(model)}), Error);
}

}  // namespace
}  // namespace kinescope
