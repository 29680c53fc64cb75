// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/effect_library.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "dynamics/data/statistics.h"
#include "dynamics/effects/candidates.h"
#include "dynamics/effects/carrier_torques.h"
#include "dynamics/effects/drive_laws.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

}  // namespace

namespace effects {

std::array<Eigen::Vector2d, kGravityStarts> gravity_starts() {
  constexpr double kRight = 90.0;
  return {Eigen::Vector2d{0, 0},       Eigen::Vector2d{kRight, 0},
          Eigen::Vector2d{-kRight, 0}, Eigen::Vector2d{0, kRight},
          Eigen::Vector2d{0, -kRight}, Eigen::Vector2d{2.0 * kRight, 0}};
}

Eigen::VectorXd joint_column(const EffectContext& context, std::size_t joint,
                             const std::string& name,
                             const std::function<Eigen::ArrayXd(const FinePath&)>& torque) {
  return context.cache->get(fmt::format("{} {}", joint, name), [&] {
    return context.motion->column(static_cast<Eigen::Index>(joint), torque);
  });
}

Eigen::VectorXd turning_column(
    const EffectContext& context, std::size_t joint, const std::string& name,
    const std::function<Eigen::ArrayXd(const FinePath&, double width)>& torque) {
  constexpr double kRatio = 1.4;
  const double width = context.widths[static_cast<Eigen::Index>(joint)];
  if (width == 0.0) {
    return joint_column(context, joint, name + " sharp",
                        [&](const FinePath& path) { return torque(path, 0.0); });
  }
  // Lagrange's cubic through four neighbours.
  const double at = std::log(width) / std::log(kRatio);
  const auto below = static_cast<int>(std::floor(at));
  Eigen::VectorXd out = Eigen::VectorXd::Zero(context.instants());
  for (int k = below - 1; k <= below + 2; ++k) {
    double weight = 1.0;
    for (int other = below - 1; other <= below + 2; ++other) {
      if (other != k) weight *= (at - other) / (k - other);
    }
    if (weight == 0.0) continue;
    out += weight *
           joint_column(context, joint, fmt::format("{} {}", name, k),
                        [&](const FinePath& path) { return torque(path, std::pow(kRatio, k)); });
  }
  return out;
}

Eigen::VectorXd direction_column(const EffectContext& context, std::size_t joint) {
  return turning_column(context, joint, "direction", [](const FinePath& path, double width) {
    return direction(path.dq, width);
  });
}

std::vector<double> ratios(double first, double last, int count) {
  std::vector<double> out;
  for (int k = 0; k < count; ++k) {
    out.push_back(first * std::pow(last / first, static_cast<double>(k) / (count - 1)));
  }
  return out;
}

std::vector<double> stribeck_speeds(const JointTravel& travel) {
  return ratios(0.03 * travel.rms_speed, 0.7 * travel.rms_speed, 10);
}

double least_stribeck_speed(const EffectContext& context, std::size_t joint) {
  constexpr double kHalf = 0.5;
  const double width = context.widths[static_cast<Eigen::Index>(joint)];
  for (const double speed : stribeck_speeds(context.travels[joint])) {
    const Eigen::VectorXd share = joint_column(
        context, joint, fmt::format("nominal stribeck {:.17g}", speed), [&](const FinePath& path) {
          return (direction(path.dq, width) * stribeck_decay(path.dq, speed)).eval();
        });
    if (share.cwiseAbs().maxCoeff() > kHalf) return speed;
  }
  return std::numeric_limits<double>::infinity();
}

std::vector<double> ripple_periods(const EffectContext& context, std::size_t joint) {
  constexpr double kLowest = 3.0;  // slower waves are what gravity and springs look like
  constexpr int kMost = 400;
  const JointTravel& travel = context.travels[joint];
  const bool turns = context.turns[joint] != 0;
  const double turn = turns ? 2.0 * std::numbers::pi : travel.range;
  // Faster than the low-pass at most speeds: nothing of it is left.
  const double cutoff_hz = context.motion->filter().cutoff_hz;
  const double highest = cutoff_hz > 0.0 ? 2.0 * cutoff_hz * turn / travel.rms_speed : kMost;
  std::vector<double> out;
  for (int n = 1; n <= kMost; n += n < 60 ? 1 : n < 120 ? 2 : 10) {
    if (n < kLowest || n > highest) continue;
    out.push_back(turns ? n : n / turn);
  }
  return out;
}

}  // namespace effects

std::string EffectContext::unit(std::size_t joint) const {
  if (torque_unit != "Nm") return torque_unit;
  return turns[joint] != 0 ? "N m" : "N";
}

const Candidate* EffectLibrary::find(const EffectId& id) const {
  const auto found = std::ranges::find(candidates, id, &Candidate::id);
  return found == candidates.end() ? nullptr : &*found;
}

void describe_log(EffectContext& context) {
  const EffectMotion& motion = *context.motion;
  context.travels.clear();
  for (Eigen::Index j = 0; j < motion.joints(); ++j) {
    const Eigen::VectorXd q = motion.at_instants(motion.samples().q.col(j));
    const Eigen::VectorXd dq = motion.at_instants(motion.samples().dq.col(j));
    // A joint that stands still has no scale of its own; its columns are zero whatever it is.
    context.travels.push_back(
        {.range = std::max(q.maxCoeff() - q.minCoeff(), 1e-9),
         .rms_speed = std::max(std::sqrt(dq.squaredNorm() / static_cast<double>(dq.size())), 1e-9),
         .high_speed = std::max(quantile(to_vector(dq.cwiseAbs()), 0.95), 1e-9)});
  }
  const Eigen::VectorXd time_s = motion.at_instants(motion.time_s());
  context.log.begin_s = time_s[0];
  context.log.duration_s = std::max(time_s[time_s.size() - 1] - time_s[0], 1e-9);
  if (context.temperature_c.size() == 0) return;
  context.log.lowest_c = context.temperature_c.minCoeff();
  context.log.range_c = std::max(context.temperature_c.maxCoeff() - context.log.lowest_c, 1e-9);
}

std::vector<Candidate> make_candidates(const EffectContext& context) {
  KINESCOPE_CHECK(context.motion != nullptr && context.cache != nullptr, "a motion and a cache");
  const auto shared = std::make_shared<const EffectContext>(context);
  std::vector<Candidate> out;
  effects::add_friction(shared, out);
  effects::add_drives(shared, out);
  effects::add_sensors(shared, out);
  effects::add_bodies(shared, out);
  return out;
}

Eigen::SparseMatrix<double> make_carriers(const EffectContext& context) {
  const TorqueSamples& samples = context.motion->samples();
  const Eigen::MatrixXd q = context.motion->rows_at_instants(samples.q);
  const Eigen::MatrixXd dq = context.motion->rows_at_instants(samples.dq);
  const Eigen::MatrixXd ddq = context.motion->rows_at_instants(samples.ddq);
  return effects::sparse_carriers(
      effects::carrier_torques(context, gravity_slopes_of_samples(context.rigid, q),
                               regressors_of_samples(context.rigid, q, dq, ddq)),
      context.instants());
}

Eigen::MatrixXd effect_torque(const Eigen::SparseMatrix<double>& carriers,
                              const Candidate& candidate, double scan,
                              const Eigen::VectorXd& values, Eigen::Index joints) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(carriers.rows() / joints, joints);
  const std::vector<EffectColumn> columns = candidate.columns(scan);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const EffectColumn& column = columns[k];
    for (Eigen::SparseMatrix<double>::InnerIterator entry(carriers, column.carrier); entry;
         ++entry) {
      const Eigen::Index instant = entry.row() / joints;
      const double share = column.share.size() > 0 ? column.share[instant] : 1.0;
      out(instant, entry.row() % joints) +=
          values[static_cast<Eigen::Index>(k)] * share * entry.value();
    }
  }
  return out;
}

namespace {

/// Two axes across gravity (columns).
Eigen::Matrix<double, 3, 2> tilt_axes(const Eigen::Vector3d& gravity) {
  const Eigen::Vector3d down = gravity.normalized();
  Eigen::Index least = 0;
  down.cwiseAbs().minCoeff(&least);
  const Eigen::Vector3d first = (Eigen::Vector3d::Unit(least) - down[least] * down).normalized();
  Eigen::Matrix<double, 3, 2> out;
  out << first, down.cross(first);
  return out;
}

}  // namespace

Eigen::Matrix<double, 3, 2> tilt_moves(const Eigen::Vector3d& gravity) {
  const Eigen::Matrix<double, 3, 2> axes = kDegree * tilt_axes(gravity);
  Eigen::Matrix<double, 3, 2> out;
  out << axes.col(0).cross(gravity), axes.col(1).cross(gravity);
  return out;
}

Eigen::Vector2d tilt_between(const Eigen::Vector3d& gravity, const Eigen::Vector3d& other) {
  const Eigen::Matrix<double, 3, 2> axes = tilt_axes(gravity);
  const Eigen::Vector3d normal = gravity.cross(other);
  const double angle = std::atan2(normal.norm(), gravity.dot(other));
  // Straight up, any axis across gravity takes it there.
  const Eigen::Vector3d axis = normal.norm() > 0.0 ? normal.normalized() : axes.col(0);
  return angle / kDegree * axes.transpose() * axis;
}

Eigen::Vector3d tilted(const Eigen::Vector3d& gravity, const Eigen::Vector2d& tilt_deg) {
  const Eigen::Vector3d turn = kDegree * tilt_axes(gravity) * tilt_deg;
  const double angle = turn.norm();
  if (!(angle > 0.0)) return gravity;
  return Eigen::AngleAxisd(angle, turn / angle) * gravity;
}

}  // namespace kinescope
