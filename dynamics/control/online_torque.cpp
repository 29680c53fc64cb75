// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/online_torque.h"

#include <utility>

#include "dynamics/simulation/drive_torque.h"

namespace kinescope {

OnlineTorque::OnlineTorque(Plant plant)
    : plant_(std::move(plant)), bodies_(plant_.rigid), load_bodies_(plant_.unloaded) {
  last_q_ = zero_ = load_ = torque_ = Eigen::VectorXd::Zero(plant_.size());
  for (const JointDrive& drive : plant_.drives) presliding_.emplace_back(drive.presliding.size());
}

void OnlineTorque::move_presliding(const MotionPoint& motion) {
  for (std::size_t j = 0; j < plant_.drives.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    for (std::size_t k = 0; k < presliding_[j].size(); ++k) {
      double& state = presliding_[j][k];
      state = begun_ ? effects::dahl_after(state, motion.q[i] - last_q_[i],
                                           plant_.drives[j].presliding[k].length)
                     : effects::sign_of(motion.dq[i]);
    }
  }
  last_q_ = motion.q;
  begun_ = true;
}

void OnlineTorque::add_coupled(const MotionPoint& motion) {
  torque_.noalias() += plant_.viscous * motion.dq;
  torque_.noalias() += plant_.coupled_inertia * motion.ddq;
  for (const CoupledDrive& drive : plant_.coupled) {
    const double speed = drive.weights.dot(motion.dq);
    torque_ += drive.coulomb * effects::direction(speed, drive.width) * drive.weights;
  }
}

const Eigen::VectorXd& OnlineTorque::at(const MotionPoint& motion) {
  move_presliding(motion);
  bodies_.torque(motion.q, motion.dq, motion.ddq, torque_);
  load_bodies_.torque(motion.q, motion.dq, motion.ddq, load_);
  for (std::size_t j = 0; j < plant_.drives.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    const JointDrive& drive = plant_.drives[j];
    torque_[i] += smooth_torque(drive, motion.q[i], motion.dq[i], motion.t_s);
    torque_[i] += dry_amplitude(drive, motion.q[i], motion.dq[i], motion.t_s, load_[i]) *
                  effects::direction(motion.dq[i], drive.width);
    for (std::size_t k = 0; k < presliding_[j].size(); ++k) {
      torque_[i] += drive.presliding[k].friction * presliding_[j][k];
    }
  }
  add_coupled(motion);
  return torque_;
}

const Eigen::VectorXd& OnlineTorque::at_rest(const Eigen::VectorXd& q, double t_s) {
  bodies_.torque(q, zero_, zero_, torque_);
  for (std::size_t j = 0; j < plant_.drives.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    torque_[i] += smooth_torque(plant_.drives[j], q[i], 0.0, t_s);
  }
  return torque_;
}

}  // namespace kinescope
