// SPDX-License-Identifier: Apache-2.0
//
// What the torque's sensor (or the current's, with the drive constant) does to it.
#include <fmt/format.h>

#include "dynamics/effects/candidates.h"

namespace kinescope::effects {
namespace {

// The slowest low-pass that a drive would have on its torque: a corner of 1.6 Hz. Measured drives
// came out at 8 to 25 ms; the 180 ms of a joint that creeps were friction (`trace_torque_real`,
// franka_joint7).
constexpr double kSlowestLag_s = 0.1;

Candidate torque_offset(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"torque_offset", c->joints[j]};
  out.words = fmt::format("the torque of {} is off by a constant", c->joints[j]);
  out.check = "zero of the torque sensor; friction that differs between the directions";
  out.record = "hold the joint in postures in which its torque should be zero";
  out.size_unit = c->unit(j);
  out.parameters = {{"offset", out.size_unit}};
  out.columns = [c, j](double) {
    return std::vector<EffectColumn>{{static_cast<int>(j), Eigen::VectorXd::Ones(c->instants())}};
  };
  return out;
}

Candidate torque_gain(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"torque_gain", c->joints[j]};
  out.words = fmt::format("the torque of {} is scaled wrongly", c->joints[j]);
  out.check = "calibration of the torque sensor; drive constant and gear ratio of the joint";
  out.record = "hold a known weight in postures in which the joint carries it";
  out.size_unit = "";
  out.parameters = {{"gain_minus_one", ""}};
  out.columns = [c, j](double) {
    return std::vector<EffectColumn>{
        {static_cast<int>(j), c->torque.col(static_cast<Eigen::Index>(j))}};
  };
  return out;
}

Candidate cross_talk(const SharedContext& c, std::size_t j, std::size_t from) {
  Candidate out;
  out.id = {"cross_talk", fmt::format("{} from {}", c->joints[j], c->joints[from])};
  out.words =
      fmt::format("the torque of {} shows a share of that of {}", c->joints[j], c->joints[from]);
  out.check = "mounting and wiring of the torque sensors; a coupled transmission";
  out.record = "load the other joint while this one is not loaded";
  out.size_unit = fmt::format("{}/{}", c->unit(j), c->unit(from));
  out.parameters = {{"share", out.size_unit}};
  out.columns = [c, j, from](double) {
    return std::vector<EffectColumn>{
        {static_cast<int>(j), c->torque.col(static_cast<Eigen::Index>(from))}};
  };
  return out;
}

Candidate torque_delay(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"torque_delay", c->joints[j]};
  out.words = fmt::format("the torque of {} is logged late", c->joints[j]);
  out.check = "filters and time stamps of the torque or current of the joint";
  out.record = "reverse the joint quickly and often";
  out.size_unit = "s";
  out.parameters = {{"delay", "s"}};
  out.columns = [c, j](double) {
    return std::vector<EffectColumn>{
        {static_cast<int>(j), -c->measured_rate.col(static_cast<Eigen::Index>(j))}};
  };
  return out;
}

/// To first order the same as a delay: only fits with one or the other in tell them apart.
Candidate torque_lag(const SharedContext& c, std::size_t j) {
  Candidate out;
  out.id = {"torque_lag", c->joints[j]};
  out.words = fmt::format("the torque of {} lags behind a low-pass of the drive", c->joints[j]);
  out.check = "low-pass of the torque or current in the drive of the joint, and its corner";
  out.record = "reverse the joint quickly and often, at several speeds";
  out.size_unit = "s";
  out.parameters = {{"time_constant", "s"}};
  out.possible = [](const Eigen::VectorXd& theta) {
    return theta[0] >= 0.0 && theta[0] <= kSlowestLag_s;
  };
  out.columns = [c, j](double) {
    return std::vector<EffectColumn>{
        {static_cast<int>(j), -c->measured_rate.col(static_cast<Eigen::Index>(j))}};
  };
  return out;
}

}  // namespace

void add_sensors(const SharedContext& context, std::vector<Candidate>& out) {
  for (std::size_t j = 0; j < context->joints.size(); ++j) {
    for (const auto& make : {torque_offset, torque_gain, torque_delay, torque_lag}) {
      out.push_back(make(context, j));
    }
    for (std::size_t from = 0; from < context->joints.size(); ++from) {
      if (from != j) out.push_back(cross_talk(context, j, from));
    }
  }
}

}  // namespace kinescope::effects
