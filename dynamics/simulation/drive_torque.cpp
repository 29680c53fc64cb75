// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/drive_torque.h"

#include <cmath>

namespace kinescope {
namespace {

double wave_torque(const JointDrive::Wave& wave, double q) {
  return wave.sine * effects::wave_sine(q, wave.number) +
         wave.cosine * effects::wave_cosine(q, wave.number);
}

/// The part of a drift that is not its offset is relative to its mean over the log.
double about_mean(const JointDrive::Drift& drift, double t_s) {
  return drift.settling.at(t_s) - drift.settling.mean();
}

}  // namespace

double smooth_torque(const JointDrive& drive, double q, double dq, double t_s) {
  double out = drive.offset + drive.stiffness * q + drive.asymmetric * std::abs(dq);
  for (const auto& power : drive.powers) {
    out += power.at_high_speed * effects::speed_power(dq, power.high_speed, power.power);
  }
  for (const auto& wave : drive.ripples) out += wave_torque(wave, q);
  for (const auto& drift : drive.drifts) {
    out += drift.offset * drift.settling.at(t_s) + drift.viscous * about_mean(drift, t_s) * dq;
  }
  return out;
}

double dry_amplitude(const JointDrive& drive, double q, double dq, double t_s, double load) {
  double out = drive.coulomb;
  for (const auto& stribeck : drive.stribecks) {
    out += stribeck.excess_at_rest * effects::stribeck_decay(dq, stribeck.speed);
  }
  for (const auto& wave : drive.position_friction) out += wave_torque(wave, q);
  for (const auto& drift : drive.drifts) out += drift.coulomb * about_mean(drift, t_s);
  if (drive.share_of_load != 0.0) out += drive.share_of_load * std::abs(load);
  return out;
}

}  // namespace kinescope
