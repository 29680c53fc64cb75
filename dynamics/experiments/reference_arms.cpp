// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/reference_arms.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kQuarter = 0.5 * std::numbers::pi;

struct PublishedBody {
  double mass_kg;
  std::array<double, 3> centre_m;
  std::array<double, 6> inertia_kgm2;  ///< xx xy xz yy yz zz, about the centre
};

CentralInertia central_of(const PublishedBody& body) {
  const auto& [xx, xy, xz, yy, yz, zz] = body.inertia_kgm2;
  CentralInertia central{body.mass_kg, Eigen::Vector3d::Map(body.centre_m.data()), {}};
  central.inertia_kgm2 << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return central;
}

InertialParameters inertia_of(const PublishedBody& body) { return from_central(central_of(body)); }

// One row of the maker's table, distal convention: a link's frame stands at its far end.
struct Ur10Link {
  double a_m, d_m, alpha_rad;
  PublishedBody body;
};

constexpr std::array<Ur10Link, 6> kUr10 = {
    {{0.0,
      0.1273,
      kQuarter,
      {7.1, {0.021, 0.0, 0.027}, {0.0341, 0.0, -0.0043, 0.0353, 0.0001, 0.0216}}},
     {-0.612, 0.0, 0.0, {12.7, {0.38, 0.0, 0.158}, {0.0281, 0.0001, -0.0156, 0.7707, 0.0, 0.7694}}},
     {-0.5723, 0.0, 0.0, {4.27, {0.24, 0.0, 0.068}, {0.0101, 0.0001, 0.0092, 0.3093, 0.0, 0.3065}}},
     {0.0,
      0.163941,
      kQuarter,
      {2.0, {0.0, 0.007, 0.018}, {0.0030, 0.0, 0.0, 0.0022, -0.0002, 0.0026}}},
     {0.0,
      0.1157,
      -kQuarter,
      {2.0, {0.0, 0.007, 0.018}, {0.0030, 0.0, 0.0, 0.0022, -0.0002, 0.0026}}},
     // The page gives 0 for its xx, which no body has: taken as its yy.
     {0.0, 0.0922, 0.0, {0.365, {0.0, 0.0, -0.026}, {0.0004, 0.0, 0.0, 0.0004, 0.0, 0.0003}}}}};

// What a joint may do.
struct Limits {
  double lower, upper, speed, acceleration;
};

// The maker's, in SI.
constexpr std::array<Limits, 7> kPandaLimits = {{{-2.8973, 2.8973, 2.175, 15.0},
                                                 {-1.7628, 1.7628, 2.175, 7.5},
                                                 {-2.8973, 2.8973, 2.175, 10.0},
                                                 {-3.0718, -0.0698, 2.175, 12.5},
                                                 {-2.8973, 2.8973, 2.61, 15.0},
                                                 {-0.0175, 3.7525, 2.61, 20.0},
                                                 {-2.8973, 2.8973, 2.61, 20.0}}};

TorqueSamples still(Eigen::Index rows, Eigen::Index joints, double rate_hz) {
  TorqueSamples log;
  log.t_s = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / rate_hz);
  log.q = log.dq = log.ddq = Eigen::MatrixXd::Zero(rows, joints);
  log.trajectory = Eigen::VectorXi::Zero(rows);
  return log;
}

void add_sine(TorqueSamples& log, Eigen::Index joint, double amplitude, double omega,
              double phase) {
  const Eigen::ArrayXd angle = omega * log.t_s.array() + phase;
  log.q.col(joint).array() += amplitude * angle.sin();
  log.dq.col(joint).array() += amplitude * omega * angle.cos();
  log.ddq.col(joint).array() -= amplitude * omega * omega * angle.sin();
}

// One joint of the Panda as in the LIP paper; columns q, dq, ddq.
bool try_harmonics(TorqueSamples& log, Eigen::Index joint, double coefficient, Rng& rng) {
  constexpr int kHarmonics = 50;
  constexpr double kBase_rad_s = 0.02;
  constexpr double kRangeShare = 0.5;
  const Limits& limits = kPandaLimits[static_cast<std::size_t>(joint)];
  log.q.col(joint).setZero();
  log.dq.col(joint).setZero();
  log.ddq.col(joint).setZero();
  for (int l = 1; l <= kHarmonics; ++l) {
    const double omega = kBase_rad_s * l;
    add_sine(log, joint, rng.uniform(-coefficient, coefficient), omega, 0.0);
    add_sine(log, joint, rng.uniform(-coefficient, coefficient), omega, kQuarter);
  }
  const auto largest = [&](const Eigen::MatrixXd& part) {
    return part.col(joint).cwiseAbs().maxCoeff();
  };
  const bool fits = largest(log.q) <= 0.5 * kRangeShare * (limits.upper - limits.lower) &&
                    largest(log.dq) <= limits.speed && largest(log.ddq) <= limits.acceleration;
  log.q.col(joint).array() += 0.5 * (limits.lower + limits.upper);
  return fits;
}

}  // namespace

DynamicModel dh_arm(const std::vector<std::array<double, 3>>& rows) {
  KinematicTree tree;
  tree.links.push_back({"base"});
  for (const auto& [a, alpha, d] : rows) {
    const auto index = static_cast<int>(tree.joints.size());
    Joint joint;
    joint.name = fmt::format("joint{}", index + 1);
    joint.type = JointType::kRevolute;
    joint.parent = LinkId{index};
    joint.child = LinkId{index + 1};
    joint.T_parent_joint =
        Pose{exp_rotation(Eigen::Vector3d::UnitX() * alpha), Eigen::Vector3d::UnitX() * a} *
        Pose{Eigen::Quaterniond::Identity(), Eigen::Vector3d::UnitZ() * d};
    tree.joints.push_back(joint);
    tree.links.push_back({fmt::format("link{}", index + 1)});
  }
  return without_masses(tree);
}

DynamicModel panda_kinematics() {
  DynamicModel model = dh_arm({{0, 0, 0.333},
                               {0, -kQuarter, 0},
                               {0, kQuarter, 0.316},
                               {0.0825, kQuarter, 0},
                               {-0.0825, -kQuarter, 0.384},
                               {0, kQuarter, 0},
                               {0.088, kQuarter, 0}});
  for (std::size_t j = 0; j < kPandaLimits.size(); ++j) {
    model.tree.joints[j].limits = JointLimits{kPandaLimits[j].lower, kPandaLimits[j].upper};
  }
  return model;
}

DynamicModel panda_arm() {
  static constexpr std::array<PublishedBody, 7> kBodies = {
      {{4.970684,
        {3.875e-3, 2.081e-3, -4.762e-2},
        {7.0337e-1, -1.39e-4, 6.772e-3, 7.0661e-1, 1.9169e-2, 9.117e-3}},
       {0.646926,
        {-3.141e-3, -2.872e-2, 3.495e-3},
        {7.962e-3, -3.925e-3, 1.0254e-2, 2.811e-2, 7.04e-4, 2.5995e-2}},
       {3.228604,
        {2.7518e-2, 3.9252e-2, -6.6502e-2},
        {3.7242e-2, -4.761e-3, -1.1396e-2, 3.6155e-2, -1.2805e-2, 1.083e-2}},
       {3.587895,
        {-5.317e-2, 1.04419e-1, 2.7454e-2},
        {2.5853e-2, 7.796e-3, -1.332e-3, 1.9552e-2, 8.641e-3, 2.8323e-2}},
       {1.225946,
        {-1.1953e-2, 4.1065e-2, -3.8437e-2},
        {3.5549e-2, -2.117e-3, -4.037e-3, 2.9474e-2, 2.29e-4, 8.627e-3}},
       {1.666555,
        {6.0149e-2, -1.4117e-2, -1.0517e-2},
        {1.964e-3, 1.09e-4, -1.158e-3, 4.354e-3, 3.41e-4, 5.433e-3}},
       {0.735522,
        {1.0517e-2, -4.252e-3, 6.1597e-2},
        {1.2516e-2, -4.28e-4, -1.196e-3, 1.0027e-2, -7.41e-4, 4.815e-3}}}};
  DynamicModel model = panda_kinematics();
  for (std::size_t j = 0; j < kBodies.size(); ++j) model.links[j + 1] = inertia_of(kBodies[j]);
  return model;
}

DynamicModel ur10_kinematics() {
  std::vector<std::array<double, 3>> rows;
  for (std::size_t j = 0; j < kUr10.size(); ++j) {
    const double a = j > 0 ? kUr10[j - 1].a_m : 0.0;
    const double alpha = j > 0 ? kUr10[j - 1].alpha_rad : 0.0;
    rows.push_back({a, alpha, kUr10[j].d_m});
  }
  DynamicModel model = dh_arm(rows);
  constexpr double kTurn = 2.0 * std::numbers::pi;
  for (Joint& joint : model.tree.joints) joint.limits = JointLimits{-kTurn, kTurn};
  return model;
}

DynamicModel ur10_arm() {
  DynamicModel model = ur10_kinematics();
  for (std::size_t j = 0; j < kUr10.size(); ++j) {
    const Eigen::Matrix3d turn =
        exp_rotation(Eigen::Vector3d::UnitX() * kUr10[j].alpha_rad).toRotationMatrix();
    CentralInertia body = central_of(kUr10[j].body);
    body.centre_m = turn * body.centre_m + kUr10[j].a_m * Eigen::Vector3d::UnitX();
    body.inertia_kgm2 = turn * body.inertia_kgm2 * turn.transpose();
    model.links[j + 1] = from_central(body);
  }
  return model;
}

DynamicModel scara_arm() {
  DynamicModel model = dh_arm({{0, 0, 0.3}, {0.3, 0, 0.05}, {0.25, 0, 0}, {0, 0, 0}});
  const std::array<JointLimits, 4> limits = {
      {{-2.2, 2.2}, {-2.4, 2.4}, {-0.15, 0.15}, {-3.1, 3.1}}};
  for (std::size_t j = 0; j < limits.size(); ++j) model.tree.joints[j].limits = limits[j];
  model.tree.joints[2].type = JointType::kPrismatic;
  model.links[1] =
      inertia_of({6.0, {0.14, 0.003, 0.01}, {0.012, 0.001, -0.002, 0.07, 0.001, 0.075}});
  model.links[2] =
      inertia_of({4.5, {0.12, -0.002, 0.03}, {0.010, -0.001, 0.003, 0.045, 0.001, 0.048}});
  model.links[3] = inertia_of({0.9, {0.0, 0.0, -0.05}, {0.008, 0, 0, 0.008, 0, 0.0004}});
  model.links[4] =
      inertia_of({0.6, {0.02, 0.01, 0.04}, {0.0012, 0.0001, 0, 0.0010, 0.0001, 0.0011}});
  return model;
}

DynamicModel misplaced(DynamicModel model, double tilt_rad, double shift_m, Rng& rng) {
  for (Joint& joint : model.tree.joints) {
    const Pose error{exp_rotation(rng.normal3(tilt_rad)), rng.normal3(shift_m)};
    joint.T_parent_joint = joint.T_parent_joint * error;
  }
  return model;
}

TorqueSamples sinusoid_log(const DynamicModel& model, const SinusoidOptions& options, Rng& rng) {
  const RigidModel rigid = make_rigid_model(model);
  TorqueSamples log = still(options.samples, rigid.size(), options.rate_hz);
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (Eigen::Index j = 0; j < log.joints(); ++j) {
    const auto& limits = model.tree.joints[joints[static_cast<std::size_t>(j)].index()].limits;
    KINESCOPE_CHECK(limits.has_value(), "the arm's joints have limits");
    for (int k = 0; k < options.sines; ++k) {
      const double omega =
          2.0 * std::numbers::pi * rng.uniform(options.lowest_hz, options.highest_hz);
      const double phase = rng.uniform(0.0, 2.0 * std::numbers::pi);
      add_sine(log, j, rng.normal(), omega, phase);
    }
    const double scale = 0.5 * options.range_share * (limits->upper - limits->lower) /
                         log.q.col(j).cwiseAbs().maxCoeff();
    log.q.col(j) *= scale;
    log.dq.col(j) *= scale;
    log.ddq.col(j) *= scale;
    log.q.col(j).array() += 0.5 * (limits->lower + limits->upper);
  }
  log.torque = inverse_dynamics_of_samples(rigid, log.q, log.dq, log.ddq);
  return log;
}

TorqueSamples panda_log(const DynamicModel& model, Rng& rng) {
  constexpr Eigen::Index kSamples = 500;
  constexpr double kRate_hz = 10.0;
  constexpr int kTries = 10;
  const RigidModel rigid = make_rigid_model(model);
  TorqueSamples log = still(kSamples, rigid.size(), kRate_hz);
  for (Eigen::Index j = 0; j < log.joints(); ++j) {
    const Limits& limits = kPandaLimits[static_cast<std::size_t>(j)];
    double coefficient = 0.1 * (limits.upper - limits.lower);
    for (int tries = 1; !try_harmonics(log, j, coefficient, rng); ++tries) {
      if (tries % kTries == 0) coefficient *= 0.8;
    }
  }
  log.torque = inverse_dynamics_of_samples(rigid, log.q, log.dq, log.ddq);
  return log;
}

void add_white_noise(TorqueSamples& samples, const Eigen::RowVectorXd& sigma, Rng& rng) {
  for (Eigen::Index j = 0; j < samples.joints(); ++j) {
    for (Eigen::Index i = 0; i < samples.size(); ++i) samples.torque(i, j) += rng.normal(sigma[j]);
  }
}

}  // namespace kinescope
