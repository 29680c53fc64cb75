// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/base_parameters.h"

#include <numbers>
#include <numeric>

#include <gtest/gtest.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "tests/kinematics/model/random_tree.h"
#include "tests/truth/random_dynamics.h"

namespace kinescope {
namespace {

/// One row of a modified Denavit-Hartenberg table (Craig): Rot_x(alpha) Trans_x(a) Rot_z(theta0)
/// Trans_z(d).
struct DhRow {
  double a;
  double alpha;
  double d;
  double theta0 = 0.0;
  JointType type = JointType::kRevolute;
};

DynamicModel dh_robot(const std::vector<DhRow>& rows) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (const DhRow& row : rows) {
    const auto index = static_cast<int>(tree.joints.size());
    Joint joint;
    joint.name = "joint" + std::to_string(index + 1);
    joint.type = row.type;
    joint.parent = LinkId{index};
    joint.child = LinkId{index + 1};
    const Eigen::Quaterniond tilt = exp_rotation(Eigen::Vector3d::UnitX() * row.alpha);
    joint.T_parent_joint =
        Pose{tilt, Eigen::Vector3d::UnitX() * row.a} *
        Pose{exp_rotation(Eigen::Vector3d::UnitZ() * row.theta0), Eigen::Vector3d::UnitZ() * row.d};
    tree.joints.push_back(joint);
    tree.links.push_back({"link" + std::to_string(index + 1)});
  }
  return without_masses(tree);
}

constexpr double kHalfTurn = std::numbers::pi;
constexpr double kQuarter = 0.5 * std::numbers::pi;

/// PUMA 560, Craig 2005, section 3.7 (m).
std::vector<DhRow> puma() {
  return {{0, 0, 0},        {0, -kQuarter, 0}, {0.4318, 0, 0.1501}, {0.0203, -kQuarter, 0.4318},
          {0, kQuarter, 0}, {0, -kQuarter, 0}};
}

TEST(BaseParameters, KnownCounts) {
  // 36 for the PUMA with a vertical first axis: Gautier and Khalil 1990, without motor inertias.
  EXPECT_EQ(base_parameters(make_rigid_model(dh_robot(puma()))).size(), 36);
  // With gravity across the first axis its two first moments act too.
  DynamicModel tilted = dh_robot(puma());
  tilted.gravity_m_s2 = {0.0, -kUsualGravity_m_s2, 0.0};
  EXPECT_EQ(base_parameters(make_rigid_model(tilted)).size(), 38);
  // A pendulum has three, about a vertical axis one.
  DynamicModel one = dh_robot({{0, 0, 0}});
  EXPECT_EQ(base_parameters(make_rigid_model(one)).size(), 1);
  one.gravity_m_s2 = {0.0, -kUsualGravity_m_s2, 0.0};
  EXPECT_EQ(base_parameters(make_rigid_model(one)).size(), 3);
  // Two parallel joints: I1 + m2 l^2, m2 c2 (x, y), I2 when gravity is along them; across them also
  // m1 c1 + m2 l and m1 c1y.
  DynamicModel two = dh_robot({{0, 0, 0}, {0.4, 0, 0}});
  EXPECT_EQ(base_parameters(make_rigid_model(two)).size(), 4);
  two.gravity_m_s2 = {0.0, -kUsualGravity_m_s2, 0.0};
  EXPECT_EQ(base_parameters(make_rigid_model(two)).size(), 6);
  // A sliding joint alone has its mass only; nothing else, whatever gravity.
  EXPECT_EQ(
      base_parameters(make_rigid_model(dh_robot({{0, 0, 0, 0, JointType::kPrismatic}}))).size(), 1);
}

TEST(BaseParameters, SevenJointArm) {
  // 43 for the Panda: Gaz et al. 2019, section II; and for a revolute chain with a vertical first
  // joint and no parallel neighbours 7 n - 6: Mayeda, Yoshida, Osuka 1990.
  const std::vector<DhRow> panda = {
      {0, 0, 0.333},         {0, -kQuarter, 0},           {0, kQuarter, 0.316},
      {0.0825, kQuarter, 0}, {-0.0825, -kQuarter, 0.384}, {0, kQuarter, 0},
      {0.088, kQuarter, 0}};
  EXPECT_EQ(base_parameters(make_rigid_model(dh_robot(panda))).size(), 43);
}

TEST(BaseParameters, NamesAreFormulas) {
  DynamicModel two = dh_robot({{0, 0, 0}, {0.4, 0, 0}});
  two.gravity_m_s2 = {0.0, -kUsualGravity_m_s2, 0.0};
  const BaseParameters base = base_parameters(make_rigid_model(two));
  const std::vector<std::string> expected = {"mcx(link1) + 0.4 m(link2)",
                                             "mcy(link1)",
                                             "Izz(link1) + 0.16 m(link2)",
                                             "mcx(link2)",
                                             "mcy(link2)",
                                             "Izz(link2)"};
  EXPECT_EQ(base.names, expected);
}

TEST(BaseParameters, TheyGiveTheTorqueOfEveryRobot) {
  Rng rng = Rng::from_name("BaseParameters.TheyGiveTheTorqueOfEveryRobot");
  for (int robot = 0; robot < 20; ++robot) {
    const DynamicModel dynamic =
        random_masses(random_tree(rng, 1 + rng.index(9), 0), {.motors = false}, rng);
    const RigidModel model = make_rigid_model(dynamic);
    if (model.bodies.empty()) continue;
    const BaseParameters base = base_parameters(model);
    const Eigen::VectorXd values = base.basis.regroup * body_parameters(model);
    const RandomStates states = random_states(dynamic.tree, 10, rng);
    const Eigen::MatrixXd torque =
        inverse_dynamics_of_samples(model, states.q, states.dq, states.ddq);
    const std::vector<Eigen::MatrixXd> Y =
        regressors_of_samples(model, states.q, states.dq, states.ddq);
    for (std::size_t j = 0; j < Y.size(); ++j) {
      const Eigen::VectorXd from_base = Y[j](Eigen::all, base.basis.kept) * values;
      const auto column = torque.col(static_cast<Eigen::Index>(j));
      // Regrouping coefficients of up to some hundred, found to 1e-12.
      EXPECT_LT((from_base - column).lpNorm<Eigen::Infinity>(),
                1e-9 * std::max(1.0, column.lpNorm<Eigen::Infinity>()))
          << robot;
    }
  }
}

TEST(BaseParameters, TheGapIsWide) {
  const BaseParameters base = base_parameters(make_rigid_model(dh_robot(puma())));
  const Eigen::VectorXd& s = base.basis.singular_values;
  EXPECT_GT(s[base.size() - 1], 1e6 * s[base.size()]);
}

TEST(BaseParameters, AnotherSeedFindsTheSame) {
  const RigidModel model = make_rigid_model(dh_robot(puma()));
  const BaseParameters a = base_parameters(model);
  const BaseParameters b = base_parameters(model, {.seed = 99});
  EXPECT_EQ(a.basis.kept, b.basis.kept);
  EXPECT_EQ(a.names, b.names);
  EXPECT_LT((a.basis.regroup - b.basis.regroup).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(BaseParameters, FixedLinksAddToTheBodyThatCarriesThem) {
  DynamicModel model = dh_robot({{0, 0, 0}, {0.4, kQuarter, 0}});
  const auto count = base_parameters(make_rigid_model(model)).size();
  Joint tool;
  tool.name = "tool_joint";
  tool.parent = LinkId{2};
  tool.child = LinkId{3};
  tool.T_parent_joint.translation = {0.1, 0.2, 0.3};
  model.tree.joints.push_back(tool);
  model.tree.links.push_back({"tool"});
  model.links.push_back(from_central({.mass_kg = 1.0, .centre_m = {0.0, 0.0, 0.1}}));
  model.joints.push_back({});
  const RigidModel rigid = make_rigid_model(model);
  EXPECT_EQ(base_parameters(rigid).size(), count);
  EXPECT_EQ(rigid.bodies[1].inertia.mass_kg, 1.0);
  EXPECT_LT((rigid.bodies[1].inertia.first_moment_kgm - Eigen::Vector3d(0.1, 0.2, 0.4)).norm(),
            1e-14);
}

TEST(IndependentColumns, HoldWhatTheySay) {
  Rng rng = Rng::from_name("IndependentColumns.HoldWhatTheySay");
  Eigen::MatrixXd W(20, 5);
  for (Eigen::Index k = 0; k < 3; ++k) {
    for (Eigen::Index r = 0; r < 20; ++r) W(r, k) = rng.normal();
  }
  W.col(3).setZero();
  W.col(4) = 2.0 * W.col(0) - 1e3 * W.col(2);
  std::vector<int> order(5);
  std::iota(order.begin(), order.end(), 0);
  const ColumnBasis basis = independent_columns(W, order, 1e-9);
  EXPECT_EQ(basis.kept, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(basis.without_effect, (std::vector<int>{3}));
  EXPECT_LT((W(Eigen::all, basis.kept) * basis.regroup - W).norm(), 1e-9);
  const ColumnBasis other = independent_columns(W, {4, 3, 2, 1, 0}, 1e-9);
  EXPECT_EQ(other.kept, (std::vector<int>{1, 2, 4}));
}

TEST(BaseParameters, ANameHasNoRoundingErrors) {
  const Eigen::Vector3d row(1.0, 1.32e-9, -1e-4);
  EXPECT_EQ(combination_name(row, {"coulomb(j1)", "mcy(l3)", "m(l2)"}, 0),
            "coulomb(j1) - 0.0001 m(l2)");
}

}  // namespace
}  // namespace kinescope
