// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/ur10.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <Eigen/LU>

#include "dynamics/data/splits.h"
#include "dynamics/experiments/reference_arms.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Joints = Eigen::Matrix<double, 6, 1>;

constexpr double kStep_s = 1.0 / 125.0;
constexpr int kPaperSamples = 40000;
constexpr int kPaperTest = 25000;
constexpr double kDegree = std::numbers::pi / 180.0;

// The maker's highest speeds. Joint 2 stays 60 degrees about upright and joint 3 off its ends, so
// that no point is inside the table or the arm's own base.
struct Room {
  double middle_deg, reach_deg, speed_deg_s;
};
constexpr std::array<Room, 6> kRoom = {
    {{0, 180, 120}, {-90, 60, 120}, {0, 150, 180}, {-90, 180, 180}, {0, 180, 180}, {0, 180, 180}}};

TorqueSamples motionless(Index samples) {
  TorqueSamples out;
  out.t_s = VectorXd::LinSpaced(samples, 0.0, static_cast<double>(samples - 1) * kStep_s);
  out.q = out.dq = out.ddq = out.torque = MatrixXd::Zero(samples, kRoom.size());
  out.trajectory = Eigen::VectorXi::Zero(samples);
  return out;
}

Joints random_point(Rng& rng) {
  Joints out;
  for (std::size_t j = 0; j < kRoom.size(); ++j) {
    const Room& room = kRoom[j];
    out[static_cast<Index>(j)] =
        kDegree * (room.middle_deg + rng.uniform(-room.reach_deg, room.reach_deg));
  }
  return out;
}

// The polynomial of degree 7 from 0 to 1 with no speed, acceleration and jerk at either end.
struct Way {
  double at, speed, acceleration;
};
constexpr double kWaySpeed = 35.0 / 16.0;  // its highest

Way way_at(double u) {
  const double v = 1.0 - u;
  return {u * u * u * u * (35.0 - 84.0 * u + 70.0 * u * u - 20.0 * u * u * u),
          140.0 * u * u * u * v * v * v, 420.0 * u * u * v * v * (1.0 - 2.0 * u)};
}

// The joint that is slowest at this share of its highest speed decides.
double duration_of(const Joints& way, double speed_share) {
  double out = 0.0;
  for (std::size_t j = 0; j < kRoom.size(); ++j) {
    const double speed = speed_share * kDegree * kRoom[j].speed_deg_s;
    out = std::max(out, kWaySpeed * std::abs(way[static_cast<Index>(j)]) / speed);
  }
  return out;
}

// Five-point central differences over rows (error of order step^4); the two rows at either end get
// those of the third.
MatrixXd differences(const MatrixXd& values, const std::array<double, 5>& weights, double scale) {
  const Index inner = values.rows() - 4;
  KINESCOPE_CHECK(inner > 0, "five rows");
  MatrixXd out = MatrixXd::Zero(values.rows(), values.cols());
  for (Index k = 0; k < 5; ++k) {
    out.middleRows(2, inner) +=
        weights[static_cast<std::size_t>(k)] / scale * values.middleRows(k, inner);
  }
  out.topRows(2).rowwise() = out.row(2).eval();
  out.bottomRows(2).rowwise() = out.row(inner + 1).eval();
  return out;
}

MatrixXd first_differences(const MatrixXd& values) {
  return differences(values, {1, -8, 0, 8, -1}, 12.0 * kStep_s);
}
MatrixXd second_differences(const MatrixXd& values) {
  return differences(values, {-1, 16, -30, 16, -1}, 12.0 * kStep_s * kStep_s);
}

// Newton's method from a posture near by.
Joints posture_for(const KinematicTree& tree, const Pose& T_base_tool, Joints q) {
  constexpr double kExact = 1e-13;
  constexpr int kMostSteps = 20;
  const LinkId tool = tree.joints.back().child;
  for (int step = 0; step < kMostSteps; ++step) {
    const Pose T_base_now = forward_kinematics(tree, q)[tool.index()];
    const Vector6d error = log_pose(T_base_now.inverse() * T_base_tool);
    q += body_jacobian(tree, q, tool).partialPivLu().solve(error);
    if (error.norm() < kExact) break;
  }
  return q;
}

Rng ur10_generator(std::string_view part, int run, const Ur10Options& options) {
  return Rng::from_name("ur10 " + std::string(part) + " " + std::to_string(run), options.seed);
}

// The torque that a current tells: what the link behind the spring takes, and friction.
void add_torques(const DynamicModel& arm, TorqueSamples& motors) {
  motors.torque = links_behind_springs(arm, motors).torque;
  for (Index j = 0; j < motors.joints(); ++j) {
    const ElasticDrive& drive = ur10_drives()[static_cast<std::size_t>(j)];
    motors.torque.col(j) += drive.viscous_nms_rad * motors.dq.col(j);
    motors.torque.col(j).array() += drive.coulomb_nm * motors.dq.col(j).array().sign();
  }
}

TorqueSamples thinned(const TorqueSamples& all, int samples) {
  return select_rows(all, evenly_chosen(all.size(), samples));
}

TorqueSamples one_after_another(const TorqueSamples& a, const TorqueSamples& b) {
  const auto stacked = [](const MatrixXd& top, const MatrixXd& bottom) {
    return (MatrixXd(top.rows() + bottom.rows(), top.cols()) << top, bottom).finished();
  };
  TorqueSamples out = a;
  out.t_s = stacked(a.t_s, b.t_s);
  out.q = stacked(a.q, b.q);
  out.dq = stacked(a.dq, b.dq);
  out.ddq = stacked(a.ddq, b.ddq);
  out.torque = stacked(a.torque, b.torque);
  out.trajectory.resize(out.t_s.size());
  out.trajectory << Eigen::VectorXi::Zero(a.size()), Eigen::VectorXi::Ones(b.size());
  return out;
}

}  // namespace

const std::array<ElasticDrive, 6>& ur10_drives() {
  static constexpr std::array<ElasticDrive, 6> kDrives = {{{21.3, 12.5, 6.7e4, 1.5},
                                                           {20.2, 13.3, 6.7e4, 1.5},
                                                           {10.4, 5.0, 3.1e4, 0.68},
                                                           {3.6, 2.0, 1.0e4, 0.18},
                                                           {2.5, 2.7, 1.0e4, 0.28},
                                                           {3.0, 2.3, 1.0e4, 0.20}}};
  return kDrives;
}

TorqueSamples random_points(int samples, Rng& rng) {
  constexpr double kSlowest = 0.2;  // of the highest speed
  TorqueSamples out = motionless(samples);
  Joints from = random_point(rng);
  Joints way = random_point(rng) - from;
  double begin_s = 0.0;
  double duration_s = duration_of(way, rng.uniform(kSlowest, 1.0));
  for (Index i = 0; i < out.size(); ++i) {
    while (out.t_s[i] - begin_s > duration_s) {
      begin_s += duration_s;
      from += way;
      way = random_point(rng) - from;
      duration_s = duration_of(way, rng.uniform(kSlowest, 1.0));
    }
    const Way at = way_at((out.t_s[i] - begin_s) / duration_s);
    out.q.row(i) = (from + at.at * way).transpose();
    out.dq.row(i) = at.speed / duration_s * way.transpose();
    out.ddq.row(i) = at.acceleration / (duration_s * duration_s) * way.transpose();
  }
  return out;
}

TorqueSamples tool_circle(int samples, Rng& rng) {
  constexpr double kRadius_m = 0.2;
  constexpr double kTurns_hz = 0.25;     // 0.3 m/s at the tool
  constexpr double kComesAndGoes = 0.8;  // of the speed
  constexpr double kEvery_hz = 0.07;
  // In front of the arm, far from every singular posture, and the tool leans: upright, joint 5
  // would rest, where friction is anywhere.
  const Joints middle =
      (Joints() << rng.uniform(-std::numbers::pi, std::numbers::pi), -1.2, 1.9, -2.0, -1.1, 0.4)
          .finished();
  const DynamicModel arm = ur10_kinematics();
  const Pose T_base_middle = forward_kinematics(arm.tree, middle).back();
  const Eigen::Matrix3d plane = exp_rotation(rng.normal3(1.0)).toRotationMatrix();
  TorqueSamples out = motionless(samples);
  MatrixXd q(samples + 4, kRoom.size());  // two steps before and after, for the differences
  Joints posture = middle;
  constexpr double kTurn = 2.0 * std::numbers::pi;
  for (Index i = 0; i < q.rows(); ++i) {
    const double t_s = static_cast<double>(i - 2) * kStep_s;
    const double phase =
        kTurn * kTurns_hz *
        (t_s - kComesAndGoes / (kTurn * kEvery_hz) * std::cos(kTurn * kEvery_hz * t_s));
    Pose T_base_tool = T_base_middle;
    T_base_tool.translation +=
        kRadius_m * plane * Eigen::Vector3d(std::cos(phase), std::sin(phase), 0.0);
    posture = posture_for(arm.tree, T_base_tool, posture);
    q.row(i) = posture.transpose();
  }
  out.q = q.middleRows(2, samples);
  out.dq = first_differences(q).middleRows(2, samples);
  out.ddq = second_differences(q).middleRows(2, samples);
  return out;
}

TorqueSamples links_behind_springs(const DynamicModel& arm, const TorqueSamples& motors) {
  // The gears give way by milliradians: each pass is a correction to the torque of the one before.
  constexpr int kPasses = 3;
  const RigidModel rigid = make_rigid_model(arm);
  TorqueSamples out = motors;
  for (int pass = 0; pass < kPasses; ++pass) {
    out.torque = inverse_dynamics_of_samples(rigid, out.q, out.dq, out.ddq);
    if (pass + 1 == kPasses) break;
    MatrixXd twist = out.torque;
    for (Index j = 0; j < twist.cols(); ++j) {
      twist.col(j) /= ur10_drives()[static_cast<std::size_t>(j)].stiffness_nm_rad;
    }
    out.q = motors.q - twist;
    out.dq = motors.dq - first_differences(twist);
    out.ddq = motors.ddq - second_differences(twist);
  }
  return out;
}

ComparisonCase ur10_case(int run, const Ur10Options& options) {
  const DynamicModel arm = ur10_arm();
  Rng learned = ur10_generator("train", run, options);
  Rng judged = ur10_generator("test", run, options);
  const int points_wanted = (options.test_samples + 1) / 2;
  const int circle_wanted = options.test_samples / 2;
  TorqueSamples train = random_points(std::max(options.samples, kPaperSamples), learned);
  TorqueSamples points = random_points(std::max(points_wanted, kPaperTest / 2), judged);
  TorqueSamples circle = tool_circle(std::max(circle_wanted, kPaperTest / 2), judged);
  for (TorqueSamples* motors : {&train, &points, &circle}) add_torques(arm, *motors);
  ComparisonCase out{
      ur10_kinematics(), thinned(train, options.samples),
      one_after_another(thinned(points, points_wanted), thinned(circle, circle_wanted))};
  out.test.trajectory_names = {"random points", "circle"};
  Eigen::RowVectorXd sigma(static_cast<Index>(kRoom.size()));
  for (std::size_t j = 0; j < kRoom.size(); ++j) {
    sigma[static_cast<Index>(j)] = ur10_drives()[j].noise_nm;
  }
  Rng noise = ur10_generator("noise", run, options);
  add_white_noise(out.train, sigma, noise);
  return out;
}

}  // namespace kinescope::experiments
