// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/balance.h"

#include <cmath>
#include <utility>

#include "kinematics/core/error.h"

namespace kinescope {

std::vector<DriveFriction> friction_of(const DynamicModel& model) {
  std::vector<DriveFriction> out;
  for (const JointId joint : moving_joints(model.tree)) {
    const JointDynamics& own = model.joints[joint.index()];
    out.push_back({.viscous = own.viscous, .coulomb = own.coulomb});
  }
  return out;
}

RigidBalance::RigidBalance(RigidModel model, std::vector<DriveFriction> friction)
    : recursion_(std::move(model)), friction_(std::move(friction)) {
  const Eigen::Index n = recursion_.model().size();
  if (friction_.empty()) friction_.resize(static_cast<std::size_t>(n));
  if (friction_.size() != static_cast<std::size_t>(n)) {
    throw bad_request("contact", "friction of another number of joints than the model has",
                      "give one entry a movable joint");
  }
  sample_ = {.momentum = Eigen::VectorXd::Zero(n),
             .drive = Eigen::VectorXd::Zero(n),
             .velocity = Eigen::VectorXd::Zero(n),
             .mass = Eigen::MatrixXd::Zero(n, n),
             .sigma = Eigen::VectorXd::Ones(n)};
}

const BalanceSample& RigidBalance::evaluate(double stamp_s,
                                            const Eigen::Ref<const Eigen::VectorXd>& q,
                                            const Eigen::Ref<const Eigen::VectorXd>& dq,
                                            const Eigen::Ref<const Eigen::VectorXd>& torque) {
  const MomentumTerms& terms = recursion_.evaluate(q, dq);
  sample_.stamp_s = stamp_s;
  sample_.momentum = terms.momentum;
  sample_.velocity = dq;
  sample_.mass = terms.mass;
  sample_.drive = torque - terms.gravity_torque + terms.velocity_torque;
  for (Eigen::Index j = 0; j < dq.size(); ++j) {
    const DriveFriction& own = friction_[static_cast<std::size_t>(j)];
    const double turn = dq[j] / own.coulomb_width;
    sample_.drive[j] -= own.viscous * dq[j] + own.coulomb * std::tanh(turn) + own.offset;
    const double doubt = own.coulomb * own.reversal_doubt / own.sigma_unit;
    sample_.sigma[j] = std::sqrt(1.0 + doubt * doubt * std::exp(-turn * turn / 18.0));
  }
  return sample_;
}

std::vector<BalanceSample> balance_samples(RigidBalance balance, const TorqueSamples& samples) {
  std::vector<BalanceSample> out;
  out.reserve(static_cast<std::size_t>(samples.size()));
  for (Eigen::Index t = 0; t < samples.size(); ++t) {
    out.push_back(balance.evaluate(samples.t_s[t], samples.q.row(t).transpose(),
                                   samples.dq.row(t).transpose(),
                                   samples.torque.row(t).transpose()));
  }
  return out;
}

std::vector<BalanceSample> balance_samples(const Eigen::VectorXd& t_s,
                                           const Eigen::MatrixXd& measured,
                                           const Eigen::MatrixXd& predicted,
                                           const Eigen::MatrixXd& sigma) {
  const bool doubted = sigma.size() > 0;
  if (measured.rows() != t_s.size() || predicted.rows() != measured.rows() ||
      predicted.cols() != measured.cols() ||
      (doubted && (sigma.rows() != measured.rows() || sigma.cols() != measured.cols()))) {
    throw bad_request("contact", "measured and predicted torques of different sizes",
                      "give both as samples x joints of one log");
  }
  std::vector<BalanceSample> out(static_cast<std::size_t>(t_s.size()));
  for (Eigen::Index t = 0; t < t_s.size(); ++t) {
    BalanceSample& sample = out[static_cast<std::size_t>(t)];
    sample.stamp_s = t_s[t];
    sample.momentum = Eigen::VectorXd::Zero(measured.cols());
    sample.drive = (measured.row(t) - predicted.row(t)).transpose();
    sample.sigma = Eigen::VectorXd::Ones(measured.cols());
    if (doubted) sample.sigma = sigma.row(t).transpose();
  }
  return out;
}

bool is_finite(const BalanceSample& sample) {
  return std::isfinite(sample.stamp_s) && sample.momentum.allFinite() && sample.drive.allFinite() &&
         sample.velocity.allFinite() && sample.mass.allFinite() && sample.sigma.allFinite();
}

}  // namespace kinescope
