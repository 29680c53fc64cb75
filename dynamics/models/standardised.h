// SPDX-License-Identifier: Apache-2.0
//
// (q, dq, ddq) and torques with mean 0 and standard deviation 1, for learners that know no units.
#pragma once

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/prediction.h"

namespace kinescope::models {

class Standardised {
 public:
  explicit Standardised(const TorqueSamples& samples) {
    Eigen::MatrixXd inputs(samples.size(), 3 * samples.joints());
    inputs << samples.q, samples.dq, samples.ddq;
    input_shift_ = inputs.colwise().mean();
    input_scale_ = spread(inputs.rowwise() - input_shift_);
    torque_shift_ = samples.torque.colwise().mean();
    torque_scale_ = spread(samples.torque.rowwise() - torque_shift_);
  }

  [[nodiscard]] Eigen::MatrixXd inputs(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                       const Eigen::MatrixXd& ddq) const {
    Eigen::MatrixXd out(q.rows(), 3 * q.cols());
    out << q, dq, ddq;
    return (out.rowwise() - input_shift_).array().rowwise() / input_scale_.array();
  }
  [[nodiscard]] Eigen::MatrixXd targets(const Eigen::MatrixXd& torque) const {
    return (torque.rowwise() - torque_shift_).array().rowwise() / torque_scale_.array();
  }
  [[nodiscard]] Eigen::MatrixXd torques(const Eigen::MatrixXd& targets) const {
    Eigen::MatrixXd out = targets.array().rowwise() * torque_scale_.array();
    out.rowwise() += torque_shift_;
    return out;
  }
  [[nodiscard]] const Eigen::RowVectorXd& torque_scale() const { return torque_scale_; }

 private:
  static Eigen::RowVectorXd spread(const Eigen::MatrixXd& centred) {
    Eigen::RowVectorXd out =
        (centred.colwise().squaredNorm() / static_cast<double>(centred.rows())).cwiseSqrt();
    // A column that varies by rounding only (rad, m, N m and their rates) stays as it is.
    constexpr double kRounding = 1e-6;
    for (double& s : out) s = s > kRounding ? s : 1.0;
    return out;
  }

  Eigen::RowVectorXd input_shift_, input_scale_, torque_shift_, torque_scale_;
};

/// The same sigma for every sample, one a joint.
[[nodiscard]] inline TorquePrediction with_constant_sigma(Eigen::MatrixXd mean,
                                                          const Eigen::RowVectorXd& sigma) {
  TorquePrediction out;
  out.sigma = sigma.replicate(mean.rows(), 1);
  out.model_sigma = out.sigma;
  out.mean = std::move(mean);
  return out;
}

}  // namespace kinescope::models
