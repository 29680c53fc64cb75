// SPDX-License-Identifier: Apache-2.0
//
// The plants of the literature against MuJoCo, which builds them from bodies and joints, and
// against the balance of energy.
#include <cmath>
#include <fstream>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "dynamics/policy/systems/ball_plate.h"
#include "dynamics/policy/systems/cart_pole.h"
#include "dynamics/policy/systems/double_pendulum.h"
#include "dynamics/policy/systems/furuta.h"
#include "kinematics/core/rng.h"
#include "tests/truth/temporary_path.h"
#ifdef KINESCOPE_HAVE_MUJOCO
#include "tests/truth/mujoco_model.h"
#endif

namespace kinescope::policy {
namespace {

// Equations and engine agree to this, relative to the largest acceleration of a state.
constexpr double kEnginesAgree = 1e-9;

Eigen::VectorXd random_vector(Eigen::Index size, double range, Rng& rng) {
  Eigen::VectorXd out(size);
  for (double& value : out) value = rng.uniform(-range, range);
  return out;
}

#ifdef KINESCOPE_HAVE_MUJOCO
MujocoModel mujoco(const std::string& bodies, const std::string& actuators) {
  const auto path = truth::temporary_path("plant.xml");
  std::ofstream(path) << "<mujoco><compiler angle='radian'/><option gravity='0 0 -9.81'>"
                         "<flag contact='disable'/></option><worldbody>"
                      << bodies << "</worldbody><actuator>" << actuators << "</actuator></mujoco>";
  char error[1000] = "";
  MujocoModel out(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  EXPECT_NE(out, nullptr) << error;
  return out;
}

// Both engines at random states and inputs; positions in the order of MuJoCo's joints.
void expect_same_accelerations(const Mechanism& ours, const MujocoModel& theirs,
                               double speed_range) {
  ASSERT_NE(theirs, nullptr);
  const auto count = static_cast<int>(ours.layout.position_count());
  ASSERT_EQ(theirs->nv, count);
  ASSERT_EQ(theirs->nu, static_cast<int>(ours.layout.input_count()));
  const MujocoData data(mj_makeData(theirs.get()));
  Rng rng = Rng::from_name("Mechanism.MovesAsInMujoco " + ours.name);
  for (int sample = 0; sample < 200; ++sample) {
    Eigen::VectorXd state(2 * count);
    state << random_vector(count, 3.0, rng), random_vector(count, speed_range, rng);
    const Eigen::VectorXd input =
        random_vector(ours.layout.input_count(), 1.0, rng).cwiseProduct(ours.layout.input_limit);
    for (int k = 0; k < count; ++k) {
      data->qpos[k] = state[k];
      data->qvel[k] = state[count + k];
    }
    for (int k = 0; k < theirs->nu; ++k) data->ctrl[k] = input[k];
    mj_forward(theirs.get(), data.get());
    const Eigen::Map<const Eigen::VectorXd> expected(data->qacc, count);
    const Eigen::VectorXd actual = acceleration(ours, state, input);
    ASSERT_LT((actual - expected).lpNorm<Eigen::Infinity>(),
              kEnginesAgree * std::max(1.0, expected.lpNorm<Eigen::Infinity>()))
        << ours.name << ": " << actual.transpose() << " against " << expected.transpose();
  }
}

// A uniform rod along -z, thin.
std::string rod(double kg, double length_m) {
  const double inertia = kg * length_m * length_m / 12.0;
  return fmt::format(
      "<inertial pos='0 0 {:.17g}' mass='{:.17g}' diaginertia='{:.17g} {:.17g} "
      "1.1e-15'/>",
      -0.5 * length_m, kg, inertia, inertia);
}

TEST(Mechanism, CartPoleMovesAsInMujoco) {
  const CartPole values;
  const MujocoModel theirs = mujoco(
      fmt::format("<body><inertial pos='0 0 0' mass='{:.17g}' diaginertia='1 1 1'/>"
                  "<joint name='cart' type='slide' axis='1 0 0' damping='{:.17g}'/>"
                  "<body><joint name='pole' axis='0 -1 0'/>{}</body></body>",
                  values.cart_kg, values.friction_ns_m, rod(values.pole_kg, values.length_m)),
      "<motor joint='cart'/>");
  expect_same_accelerations(cart_pole(values), theirs, 10.0);
}

TEST(Mechanism, FurutaMovesAsInMujoco) {
  const Furuta values;
  const double arm = values.arm_kg * values.arm_m * values.arm_m / 12.0;
  // The motor's back EMF is damping, its voltage a torque.
  const double damping =
      values.arm_damping_nms + values.motor_nm_a * values.motor_nm_a / values.motor_ohm;
  const MujocoModel theirs = mujoco(
      fmt::format("<body><inertial pos='{:.17g} 0 0' mass='{:.17g}' diaginertia='{:.17g} {:.17g} "
                  "{:.17g}'/><joint name='arm' axis='0 0 1' damping='{:.17g}'/>"
                  "<body pos='{:.17g} 0 0'><joint name='pole' axis='1 0 0' damping='{:.17g}'/>{}"
                  "</body></body>",
                  0.5 * values.arm_m, values.arm_kg, arm, arm, arm, damping, values.arm_m,
                  values.pole_damping_nms, rod(values.pole_kg, values.pole_m)),
      fmt::format("<motor joint='arm' gear='{:.17g}'/>", values.motor_nm_a / values.motor_ohm));
  expect_same_accelerations(furuta(values), theirs, 20.0);
}

TEST(Mechanism, DoublePendulumsMoveAsInMujoco) {
  DoublePendulum values;
  values.damping_nms = 0.02;
  const auto link = [](double kg, double centre_m, double about_joint) {
    const double inertia = about_joint - kg * centre_m * centre_m;
    return fmt::format(
        "<inertial pos='0 0 {:.17g}' mass='{:.17g}' diaginertia='{:.17g} {:.17g} "
        "{:.17g}'/>",
        -centre_m, kg, inertia, inertia, inertia);
  };
  const std::string bodies = fmt::format(
      "<body>{}<joint name='shoulder' axis='0 1 0' damping='0.02'/><body pos='0 0 {:.17g}'>{}"
      "<joint name='elbow' axis='0 1 0' damping='0.02'/></body></body>",
      link(values.upper_kg, values.upper_centre_m, values.upper_kgm2), -values.upper_m,
      link(values.lower_kg, values.lower_centre_m, values.lower_kgm2));
  expect_same_accelerations(double_pendulum(MotorAt::kElbow, values),
                            mujoco(bodies, "<motor joint='elbow'/>"), 10.0);
  expect_same_accelerations(double_pendulum(MotorAt::kShoulder, values),
                            mujoco(bodies, "<motor joint='shoulder'/>"), 10.0);
}

// MuJoCo's ball slides: its rolling is the inertia of two motors.
TEST(Mechanism, BallPlateMovesAsInMujoco) {
  const BallPlate values;
  const double w = 2.0 * std::numbers::pi * values.servo_hz;
  const double stiffness = values.plate_kgm2 * w * w;
  const std::string plate = fmt::format(
      "<body><inertial pos='0 0 0' mass='1' diaginertia='{0:.17g} {0:.17g} {1:.17g}'/>"
      "<joint name='roll' axis='1 0 0' damping='{2:.17g}'/>"
      "<joint name='pitch' axis='0 1 0' damping='{2:.17g}'/>",
      values.plate_kgm2, 2.0 * values.plate_kgm2, 2.0 * values.plate_kgm2 * w);
  const std::string ball = fmt::format(
      "<body><inertial pos='0 0 0' mass='{0:.17g}' diaginertia='1.1e-15 1.1e-15 1.1e-15'/>"
      "<joint name='x' type='slide' axis='1 0 0' armature='{1:.17g}' damping='{2:.17g}'/>"
      "<joint name='y' type='slide' axis='0 1 0' armature='{1:.17g}' damping='{2:.17g}'/></body>",
      values.ball_kg, values.rolling_share * values.ball_kg, values.rolling_damping_ns_m);
  const MujocoModel theirs =
      mujoco(plate + ball + "</body>",
             fmt::format("<position joint='roll' kp='{0:.17g}'/><position joint='pitch' "
                         "kp='{0:.17g}'/>",
                         stiffness));
  ASSERT_NE(theirs, nullptr);
  // MuJoCo's joints: roll, pitch, x, y.
  Mechanism ours = ball_plate(values);
  const auto turned = [](const Eigen::VectorXd& v) {
    return Eigen::VectorXd(Eigen::Vector4d(v[2], v[3], v[0], v[1]));
  };
  ours.terms = [terms = ours.terms, turned](const Eigen::VectorXd& p, const Eigen::VectorXd& dp,
                                            const Eigen::VectorXd& u) {
    MotionTerms out = terms(turned(p), turned(dp), u);
    const Eigen::Vector4i order(2, 3, 0, 1);
    out.force = turned(out.force);
    out.mass = Eigen::MatrixXd(out.mass(order, order));
    return out;
  };
  expect_same_accelerations(ours, theirs, 3.0);
}
#else
TEST(Mechanism, MovesAsInMujoco) {
  GTEST_SKIP() << "MuJoCo (package libmujoco-dev) was not installed when this was built";
}
#endif

// Without friction and input nothing is lost in 10 s; of the energy that there is at the start.
void expect_energy_kept(const Mechanism& mechanism, Eigen::VectorXd state, double scale_j) {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(mechanism.layout.input_count());
  const double before = energy_j(mechanism, state);
  constexpr double kStep_s = 1e-3;
  double worst = 0.0;
  for (int k = 0; k < 1000; ++k) {
    state = move(mechanism, state, none, 10.0 * kStep_s, 10);
    worst = std::max(worst, std::abs(energy_j(mechanism, state) - before));
  }
  std::printf("%s: energy over 10 s to %.1e of its range\n", mechanism.name.c_str(),
              worst / scale_j);
  EXPECT_LT(worst, 1e-7 * scale_j) << mechanism.name;
}

TEST(Mechanism, KeepsItsEnergy) {
  const CartPole cart{.friction_ns_m = 0.0};
  expect_energy_kept(cart_pole(cart), Eigen::Vector4d(0.0, 2.5, 0.3, 1.0),
                     cart.pole_kg * kPlantGravity_m_s2 * cart.length_m);
  Furuta arm{.arm_damping_nms = 0.0, .pole_damping_nms = 0.0};
  arm.motor_nm_a = 0.0;
  expect_energy_kept(furuta(arm), Eigen::Vector4d(0.0, 2.5, 4.0, -1.0),
                     arm.pole_kg * kPlantGravity_m_s2 * arm.pole_m);
  expect_energy_kept(double_pendulum(MotorAt::kElbow), Eigen::Vector4d(2.0, 1.0, 0.5, -1.0), 3.0);
  BallPlate free{.rolling_damping_ns_m = 0.0, .servo_hz = 0.0};
  free.plate_kgm2 = 0.1;  // or the ball is soon kilometres away
  expect_energy_kept(ball_plate(free),
                     (Eigen::VectorXd(8) << 0.1, -0.05, 0.05, 0.02, 0.1, 0.2, 0.3, -0.2).finished(),
                     free.ball_kg * kPlantGravity_m_s2);
}

// What an actuator puts in is what the energy gains, less what friction takes.
TEST(Mechanism, CartFrictionTakesEnergy) {
  const Mechanism mechanism = cart_pole();
  Eigen::VectorXd state = Eigen::Vector4d(0.0, 2.5, 0.0, 0.0);
  const double before = energy_j(mechanism, state);
  double work = 0.0;
  const Eigen::VectorXd push = Eigen::VectorXd::Constant(1, 3.0);
  for (int k = 0; k < 5000; ++k) {
    const double from = state[2];
    state = move(mechanism, state, push, 1e-3, 1);
    const double speed = 0.5 * (from + state[2]);
    work += (push[0] - CartPole{}.friction_ns_m * speed) * speed * 1e-3;
  }
  // The trapezoidal rule at 1 ms.
  EXPECT_NEAR(energy_j(mechanism, state) - before, work, 1e-5 * std::abs(work));
}

}  // namespace
}  // namespace kinescope::policy
