// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/rough_torque.h"

#include "dynamics/data/statistics.h"

namespace kinescope {

Eigen::MatrixXd rough_torque_features(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                      Eigen::Index joint, double width) {
  const Eigen::Index joints = q.cols();
  Eigen::MatrixXd out(q.rows(), 3 + 2 * joints);
  out.col(0).setOnes();
  out.col(1) = dq.col(joint);
  out.col(2) = (dq.col(joint).array() / width).tanh();
  out.middleCols(3, joints) = q.array().sin();
  out.rightCols(joints) = q.array().cos();
  return out;
}

double narrow_width(const Eigen::VectorXd& speed) {
  constexpr double kOften = 0.9;
  constexpr double kWidth = 0.1;  // of that speed
  return kWidth * quantile(to_vector(speed.cwiseAbs()), kOften);
}

}  // namespace kinescope
