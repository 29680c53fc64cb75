// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/controller.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "dynamics/rigid/mass_matrix.h"

namespace kinescope {
namespace {

constexpr std::array<std::pair<ControlLaw, std::string_view>, 4> kNames = {
    {{ControlLaw::kPd, "pd"},
     {ControlLaw::kPdGravity, "pd_gravity"},
     {ControlLaw::kFeedForward, "feed_forward"},
     {ControlLaw::kComputedTorque, "computed_torque"}}};

}  // namespace

std::string_view to_string(ControlLaw law) {
  return std::ranges::find(kNames, law, &std::pair<ControlLaw, std::string_view>::first)->second;
}

std::optional<ControlLaw> control_law(std::string_view name) {
  const auto found =
      std::ranges::find(kNames, name, &std::pair<ControlLaw, std::string_view>::second);
  if (found == kNames.end()) return std::nullopt;
  return found->first;
}

const std::vector<ControlLaw>& all_control_laws() {
  static const std::vector<ControlLaw> laws = {ControlLaw::kPd, ControlLaw::kPdGravity,
                                               ControlLaw::kFeedForward,
                                               ControlLaw::kComputedTorque};
  return laws;
}

ServoGains servo_gains(const Eigen::MatrixXd& mass, double bandwidth_hz) {
  // What a joint's drive feels while all others are free to move: the least it can be.
  const Eigen::VectorXd inertia = mass.inverse().diagonal().cwiseInverse();
  const double w = 2.0 * std::numbers::pi * bandwidth_hz;
  return {inertia * (w * w), inertia * (2.0 * w)};
}

Controller::Controller(const KnownRobot& robot, const ControllerOptions& options)
    : options_(options),
      nominal_(robot.nominal),
      compensation_(robot),
      limiter_(options.limits, robot.nominal.size(), 1.0 / options.rate_hz),
      none_(Eigen::VectorXd::Zero(robot.nominal.size())),
      feedback_(none_),
      torque_(none_) {}

const Eigen::VectorXd& Controller::model_torque(const MotionPoint& reference) {
  switch (options_.law) {
    case ControlLaw::kPdGravity:
      return compensation_.at_rest(measured_.q, reference.t_s);
    case ControlLaw::kFeedForward:
      return compensation_.at(reference);
    case ControlLaw::kComputedTorque:
      asked_ = {reference.t_s, measured_.q, measured_.dq, reference.ddq};
      return compensation_.at(asked_);
    default:
      return none_;
  }
}

/// A reading that is no number is replaced by the joint's last one.
void Controller::take(const Measured& measured) {
  if (measured_.q.size() == 0) {
    measured_ = measured;
    measured_.q = measured.reference_q;
    measured_.dq = measured.reference_dq;
  }
  measured_.reference_q = measured.reference_q;
  measured_.reference_dq = measured.reference_dq;
  for (Eigen::Index j = 0; j < torque_.size(); ++j) {
    if (!std::isfinite(measured.q[j]) || !std::isfinite(measured.dq[j])) continue;
    measured_.q[j] = measured.q[j];
    measured_.dq[j] = measured.dq[j];
  }
}

void Controller::feed_back() {
  proportional_ = measured_.reference_q - measured_.q;
  derivative_ = measured_.reference_dq - measured_.dq;
  if (options_.law == ControlLaw::kComputedTorque) {
    const double w = 2.0 * std::numbers::pi * options_.bandwidth_hz;
    const Eigen::MatrixXd mass = mass_matrix(nominal_, measured_.q);
    proportional_ = w * w * mass * proportional_;
    derivative_ = 2.0 * w * mass * derivative_;
    return;
  }
  proportional_ = options_.gains.kp.cwiseProduct(proportional_);
  derivative_ = options_.gains.kd.cwiseProduct(derivative_);
}

const Eigen::VectorXd& Controller::command(const MotionPoint& reference, const Measured& measured) {
  take(measured);
  torque_ = model_torque(reference);
  feed_back();
  torque_ += proportional_;
  torque_ += derivative_;
  feedback_ = proportional_ + derivative_;
  return limiter_.apply(torque_);
}

}  // namespace kinescope
