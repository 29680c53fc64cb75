// SPDX-License-Identifier: Apache-2.0
//
// What was traced is what is simulated: torques of the library of effects along a motion, put into
// the plant, give the motion's accelerations.
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "dynamics/experiments/reference_arms.h"
#include "dynamics/simulation/robot_effects.h"
#include "dynamics/simulation/simulation.h"

namespace kinescope {
namespace {

// Relative to the accelerations: double precision through seven bodies and M^-1, which is
// ill-conditioned by the wrist's small inertias.
constexpr double kSameLaw = 1e-8;

struct Case {
  const char* effect;
  const char* place;
  double scan;
  std::vector<double> values;
  friend std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.effect; }
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"viscous", "joint2", 0.0, {3.0}},
      {"coulomb", "joint3", 0.0, {2.0}},
      {"asymmetric", "joint4", 0.0, {0.7}},
      {"stribeck", "joint1", 0.2, {1.5}},
      {"cubic_viscous", "joint5", 3.0, {0.8}},
      {"load_friction", "joint2", 0.0, {0.1}},
      {"position_friction", "joint6", 2.0, {0.3, -0.2}},
      {"motor_inertia", "joint7", 0.0, {0.02}},
      {"spring", "joint2", 0.0, {4.0, -1.0}},
      {"ripple", "joint4", 31.0, {0.5, 0.2}},
      {"drift", "joint3", 5.0, {0.4, 0.3, 0.2}},
      {"torque_offset", "joint1", 0.0, {0.6}},
      {"torque_gain", "joint2", 0.0, {0.05}},
      {"cross_talk", "joint5 from joint4", 0.0, {0.03}},
      {"cross_talk", "joint5 + joint6", 0.0, {0.2, 0.1, 0.01}},
      {"cross_talk", "joint6 - joint7", 0.0, {0.2, 0.1, 0.01}},
      {"payload", "link7", 0.0, {0.5, 0.01, 0.02, 0.05, 0.01, 0.0, 0.0, 0.01, 0.0, 0.01}},
      {"gravity_direction", "base", 0.0, {20.0, -10.0}},
  };
  return all;
}

TorqueSamples panda_motion(const DynamicModel& arm) {
  Rng rng = Rng::from_name("Plant.panda_motion");
  return sinusoid_log(arm, {.samples = 600, .rate_hz = 100.0}, rng);
}

/// A name of the case as this arm has it.
std::string place_on(const DynamicModel& arm, std::string place) {
  const std::vector<JointId> joints = moving_joints(arm.tree);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const std::string name = "joint" + std::to_string(j + 1);
    const Joint& joint = arm.tree.joints[joints[j].index()];
    if (place == "link7" && j == 6) return arm.tree.links[joint.child.index()].name;
    if (const std::size_t at = place.find(name); at != std::string::npos) {
      place.replace(at, name.size(), joint.name);
    }
  }
  return place;
}

class SameLaw : public testing::TestWithParam<Case> {};

TEST_P(SameLaw, TorquesOfTheLibraryGiveTheMotionBack) {
  const Case& c = GetParam();
  const DynamicModel arm = panda_arm();
  const TorqueSamples motion = panda_motion(arm);
  TorqueEffect effect;
  effect.id = {c.effect, place_on(arm, c.place)};
  effect.scan = c.scan;
  effect.values = Eigen::Map<const Eigen::VectorXd>(c.values.data(), std::ssize(c.values));
  const std::vector<JointTravel> travels(7, {.range = 2.0, .rms_speed = 0.4, .high_speed = 0.9});
  const CorrectedTorqueModel model =
      with_effects(arm, {effect}, travels, {.begin_s = 0.0, .duration_s = 6.0});
  const Eigen::MatrixXd measured = predict_torque(model, motion);
  const Plant plant = make_plant(model);
  const Eigen::MatrixXd torque = plant.gain.fullPivLu().solve(measured.transpose()).transpose();
  Simulation simulation(
      plant, PlantState::at(plant, motion.q.row(0).transpose(), motion.dq.row(0).transpose()));
  // The effect is felt: without it the motion is another one.
  const Eigen::MatrixXd plain = predict_torque(with_effects(arm), motion);
  EXPECT_GT((plain - measured).norm(), 1e-4 * measured.norm());
  for (Eigen::Index i = 0; i < motion.size(); i += 7) {
    PlantState state = PlantState::at(plant, motion.q.row(i).transpose(),
                                      motion.dq.row(i).transpose(), motion.t_s[i]);
    state.ddq = motion.ddq.row(i).transpose();  // of the step before: what load friction takes
    simulation.set_state(std::move(state));
    const Eigen::VectorXd ddq = simulation.acceleration(torque.row(i).transpose());
    const double scale = std::max(1.0, motion.ddq.row(i).lpNorm<Eigen::Infinity>());
    EXPECT_LT((ddq - motion.ddq.row(i).transpose()).lpNorm<Eigen::Infinity>(), kSameLaw * scale)
        << c.effect << " sample " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(EveryEffect, SameLaw, testing::ValuesIn(cases()),
                         [](const testing::TestParamInfo<Case>& param) {
                           return std::string(param.param.effect) + "_" +
                                  std::to_string(param.index);
                         });

TEST(Plant, EveryEffectOfTheLibraryIsSimulatedOrNamed) {
  const DynamicModel arm = panda_arm();
  const RobotEffects known = effects_of_robot(arm, panda_motion(arm));
  for (const Candidate& candidate : known.candidates) {
    TorqueEffect effect;
    effect.id = candidate.id;
    effect.scan = candidate.scan.empty() ? 0.0 : candidate.scan.back();
    effect.values = Eigen::VectorXd::Constant(std::ssize(candidate.parameters), 1e-3);
    const Plant plant = make_plant(with_effects(arm, {effect}, known.travels, known.log));
    // A plant has one set of bodies.
    const bool changes = candidate.id.effect == "payload_change";
    EXPECT_EQ(plant.left_out, changes ? std::vector<std::string>{"payload_change at link7"}
                                      : std::vector<std::string>{});
  }
}

}  // namespace
}  // namespace kinescope
