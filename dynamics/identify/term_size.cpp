// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/term_size.h"

#include <algorithm>
#include <cmath>

#include "dynamics/rigid/base_parameters.h"

namespace kinescope::identify {
namespace {

/// Of each term, over samples and joints.
Eigen::VectorXd root_mean_squares(const std::vector<Eigen::MatrixXd>& columns) {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(columns.front().cols());
  for (const Eigen::MatrixXd& joint : columns) squares += joint.colwise().squaredNorm().transpose();
  const auto rows = static_cast<double>(std::max<Eigen::Index>(1, columns.front().rows()));
  return (squares / rows).cwiseSqrt();
}

}  // namespace

Eigen::VectorXd usual_sizes(const RigidModel& model, const DriveTerms& drives,
                            const std::vector<TorqueTerm>& terms) {
  constexpr Eigen::Index kSamples = 60;
  const RandomMotion motion = random_motion(model, kSamples, 1);
  return root_mean_squares(term_columns(model, drives, terms, motion.q, motion.dq, motion.ddq));
}

void clear_columns_at_rest(const Eigen::VectorXd& usual, std::vector<Eigen::MatrixXd>& columns) {
  const Eigen::VectorXd size = root_mean_squares(columns);
  for (Eigen::Index k = 0; k < size.size(); ++k) {
    if (size[k] > kAtRest * usual[k]) continue;
    for (Eigen::MatrixXd& joint : columns) joint.col(k).setZero();
  }
}

}  // namespace kinescope::identify
