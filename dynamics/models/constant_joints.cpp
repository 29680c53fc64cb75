// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/constant_joints.h"

#include <cmath>

namespace kinescope {

Eigen::VectorXd left_out_nmse_percent(const LeftOutTorques& left) {
  return normalised_error_percent(left.torque, left.torque - left.residual);
}

ConstantJoints give_way_to_constant(LeftOutTorques& left, const Eigen::MatrixXd& torque) {
  ConstantJoints out;
  for (Eigen::Index j = 0; j < left.residual.cols(); ++j) {
    const double constant = left.constant_residual.col(j).squaredNorm();
    // Also where the model has no finite answer. A torque that does not vary is nobody's merit.
    if (left.residual.col(j).squaredNorm() <= constant || !(constant > 0.0)) continue;
    left.residual.col(j) = left.constant_residual.col(j);
    left.model_sigma.col(j).setZero();
    const double rms = std::sqrt(constant / static_cast<double>(left.residual.rows()));
    left.sigma.col(j).setConstant(rms);
    out.joints.push_back(static_cast<int>(j));
    out.torque.conservativeResize(std::ssize(out.joints));
    out.sigma.conservativeResize(std::ssize(out.joints));
    out.torque.tail<1>()[0] = torque.col(j).mean();
    out.sigma.tail<1>()[0] = rms;
  }
  return out;
}

TorquePrediction with_constants(TorquePrediction prediction, const ConstantJoints& constants) {
  for (std::size_t k = 0; k < constants.joints.size(); ++k) {
    const Eigen::Index j = constants.joints[k];
    const auto at = static_cast<Eigen::Index>(k);
    prediction.mean.col(j).setConstant(constants.torque[at]);
    prediction.model_sigma.col(j).setZero();
    prediction.sigma.col(j).setConstant(constants.sigma[at]);
  }
  return prediction;
}

}  // namespace kinescope
