// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attachment_cost.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "kinematics/structure/linear_motion.h"

namespace kinescope::structure_search {
namespace {

// Of a coordinate about its mean or, where neighbouring samples tell more, about the sample before
// (half the mean square step: the same for white noise, far less for a smooth motion).
double coordinate_variance(const ChainModel& model) {
  const auto n = static_cast<double>(model.coordinates.size());
  double mean = 0.0;
  for (const double c : model.coordinates) mean += c / n;
  double variance = 0.0;
  double steps = 0.0;
  double previous = model.coordinates.front();
  for (const double c : model.coordinates) {
    variance += (c - mean) * (c - mean) / n;
    steps += (c - previous) * (c - previous) / (2.0 * n);
    previous = c;
  }
  return std::min(variance, steps);
}

// What a coordinate free at every sample costs: it could have been anywhere in its range.
double coordinate_cost(const ChainFit& fit, const Motion& motion) {
  if (fit.model.joints.size() != 1 || !fit.model.joints.front().terms.empty()) return 0.0;
  const double variance = coordinate_variance(fit.model);
  double sum = 0.0;
  const Vector6d axis = axis_in_child(fit.model);
  for (const MotionSample& s : motion) {
    const double lever = (s.whitening.triangularView<Eigen::Upper>() * axis).norm();
    sum += 1.0 + std::log1p(variance * lever * lever);
  }
  return sum;
}

// Distance of the child from the axis; 0 for slides.
double axis_distance(const ChainModel& model) {
  if (model.joints.size() != 1 || model.joints.front().type != JointType::kRevolute) return 0.0;
  const Eigen::Vector3d p = model.joints.front().frame.inverse() * model.mount.translation;
  return p.head<2>().norm();
}

// How likely a channel counts rad or m, degrees, millimetres, or something of its own (a gear
// between, ticks): together 1.
struct UnitShares {
  double si = 0.0;
  double degree = 0.0;
  double millimetre = 0.0;
  double own = 1.0;
};

// Most logs are in rad or m, some in degrees or millimetres: of those that nobody declared,
// `si_share` in rad or m. Declared ones are in SI by now, and their joints rarely have a gear.
UnitShares unit_shares(ChannelUnit unit, JointType type, double si_share) {
  constexpr double kGeared = 0.02;
  if (unit == ChannelUnit::kUnknown) {
    const double other = 0.25 * (1.0 - si_share);
    return {.si = si_share, .degree = other, .millimetre = other, .own = 2.0 * other};
  }
  if (unit == ChannelUnit::kTicks) return {};
  // What turns a motor and slides a joint has a spindle between, of any pitch.
  const bool alike = (unit == ChannelUnit::kRadian) == (type == JointType::kRevolute);
  return {.si = alike ? 1.0 - kGeared : 0.0, .degree = 0.0, .millimetre = 0.0, .own = kGeared};
}

// -2 ln of prior odds and Occam factor for a scale (rad or m per unit of the channel). `rms`: of
// the readings, since degrees and millimetres come in large numbers.
double scale_penalty(double scale, double sigma, const UnitShares& shares, double rms) {
  constexpr double kLogRange = 25.0;  // natural logarithms that any scale may lie within
  constexpr double kDegree = std::numbers::pi / 180.0;
  constexpr double kMillimetre = 1e-3;
  const double size = std::abs(scale);
  const double s = std::max(sigma, 1e-12);
  const double width =
      std::min(1.0, s * std::sqrt(2.0 * std::numbers::pi) / std::max(size, 1e-300) / kLogRange);
  double best = -2.0 * std::log(shares.own * width);
  const auto consider = [&](double unit, double share) {
    if (share == 0.0) return;
    const double z = (size - unit) / std::hypot(s, 0.004 * unit);
    best = std::min(best, z * z - 2.0 * std::log(share));
  };
  consider(1.0, shares.si);
  if (rms > 0.3) consider(kDegree, shares.degree);
  if (rms > 1.0) consider(kMillimetre, shares.millimetre);
  return best;
}

}  // namespace

double motion_size(const Motion& motion) {
  if (motion.empty()) return 0.0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const auto n = static_cast<double>(motion.size());
  for (const MotionSample& s : motion) mean += s.pose.translation / n;
  const Eigen::Quaterniond middle = motion[motion.size() / 2].pose.rotation.conjugate();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  double squared = 0.0;
  for (const MotionSample& s : motion) {
    const Eigen::Vector3d w = log_rotation(middle * s.pose.rotation);
    turn += w / n;
    squared += ((s.pose.translation - mean).squaredNorm() + kLever * kLever * w.squaredNorm()) / n;
  }
  return std::sqrt(std::max(0.0, squared - kLever * kLever * turn.squaredNorm()));
}

double data_cost_of(const ChainFit& fit, const RelativeMotion& relative, int seen) {
  const double share =
      relative.motion.empty() ? 1.0 : seen / static_cast<double>(relative.motion.size());
  return share * (fit.cost + relative.log_det + coordinate_cost(fit, relative.motion));
}

double price_of_further_channel(const Readings& readings) {
  return 2.0 * std::log(100.0 * std::max(2, readings.channels()));
}

double penalty_of(const ChainFit& fit, const Readings& readings) {
  const double samples = std::max(2.0, fit.samples / fit.correlation);
  double penalty = 0.0;
  int free_parameters = fit.parameters;
  std::size_t t = 0;
  for (const ChainJoint& joint : fit.model.joints) {
    for (std::size_t k = 0; k < joint.terms.size(); ++k, ++t) {
      const ChainTerm& term = joint.terms[k];
      const double rms = readings.rms[static_cast<std::size_t>(term.channel)];
      --free_parameters;
      // How much of another joint's motion couples is no matter of units.
      const ChannelUnit unit = k == 0 ? readings.unit(term.channel) : ChannelUnit::kUnknown;
      penalty +=
          scale_penalty(term.scale / rms, fit.scale_sigma[t] * std::sqrt(fit.correlation) / rms,
                        unit_shares(unit, joint.type, readings.si_share), rms);
      // Which channel drives the joint is one choice of many.
      if (k == 0) penalty += 2.0 * std::log(std::max(1, readings.channels()));
      if (k > 0) penalty += price_of_further_channel(readings);
    }
  }
  const double r = axis_distance(fit.model);
  penalty += 3.0 * std::log1p(r * r);
  return penalty + free_parameters * std::log(samples);
}

FreeCost free_cost(const Body& body, const Readings& readings) {
  const LinkPath camera = camera_path(static_cast<int>(body.at.size()));
  const RelativeMotion relative = relative_motion(body, camera, readings);
  if (relative.motion.empty()) return {};
  const LinearMotion linear = linear_motion(relative.motion);
  const double size = motion_size(relative.motion);
  Vector6d spread;
  spread << Eigen::Vector3d::Constant(size / kLever), Eigen::Vector3d::Constant(size);
  spread /= std::sqrt(6.0);
  FreeCost cost{free_motion_cost(linear), 0.0};
  for (std::size_t i = 0; i < relative.motion.size(); ++i) {
    const Vector6d y = linear.tangent.col(static_cast<Eigen::Index>(i));
    const Matrix6d scaled = tangent_whitening(relative.motion[i], y) * spread.asDiagonal();
    const Eigen::LLT<Matrix6d> factor(Matrix6d::Identity() + scaled * scaled.transpose());
    cost.everywhere += 6.0 + 2.0 * Matrix6d(factor.matrixL()).diagonal().array().log().sum();
  }
  return cost;
}

}  // namespace kinescope::structure_search
