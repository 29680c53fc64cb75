// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attachment.h"

#include <algorithm>
#include <cmath>

#include "kinematics/structure/attachment_cost.h"
#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/chain_residuals.h"

namespace kinescope::structure_search {
namespace {

// The parameters of the joints that a link hangs by err in all samples alike, and not anew in each:
// what -2 ln likelihood falls by (never rises), with residuals S n + R e, n and e standard normal.
// Woodbury's identity and the determinant lemma.
double less_for_common_errors(const ChainFit& fit, const RelativeMotion& relative,
                              const Readings& readings) {
  const double outlier = kOutlierCost;
  if (relative.doubt.empty()) return 0.0;
  const Eigen::Index numbers = relative.doubt.front().cols();
  const ChainResiduals left = chain_residuals(relative.motion, fit.model, readings.value);
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(numbers, numbers);
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(numbers);
  double apart = 0.0;
  double alone = 0.0;
  for (std::size_t i = 0; i < relative.motion.size(); ++i) {
    const auto whitening = relative.own_whitening[i].triangularView<Eigen::Upper>();
    const Eigen::MatrixXd root = whitening * relative.doubt[i];
    information.selfadjointView<Eigen::Lower>().rankUpdate(root.transpose());
    if (left.white[i].squaredNorm() > outlier) continue;
    const Vector6d plain = whitening_of(relative.motion[i], left.other[i] != 0)
                               .triangularView<Eigen::Upper>()
                               .solve(left.white[i]);
    const Vector6d own = whitening * plain;
    pull += root.transpose() * own;
    apart += left.white[i].squaredNorm();
    alone += own.squaredNorm();
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(information.selfadjointView<Eigen::Lower>());
  if (factor.info() != Eigen::Success) return 0.0;
  const double together = alone - pull.dot(factor.solve(pull));
  const double log_det =
      2.0 * factor.matrixLLT().diagonal().array().log().sum() - relative.doubt_log_det;
  return std::clamp((together - apart) / fit.variance + log_det, std::min(0.0, log_det), 0.0);
}

}  // namespace

bool Attachment::leaves_noise_only() const {
  return fit.variance < kInexact && fit.axis_variance < kInexact;
}

double Attachment::explained_ratio() const {
  // A fifth of the noise at least: less cannot be seen.
  const double excess = std::sqrt(std::max(0.04, 1.0 - 1.0 / fit.variance));
  const double left = std::hypot(fit.translation_rms, kLever * fit.rotation_rms) * excess;
  return motion_size / std::max(left, 1e-12);
}

Attachment attachment_from(ChainFit fit, int parent, const RelativeMotion& relative,
                           const Body& body, const Readings& readings) {
  Attachment a;
  a.parent = parent;
  a.data_cost = data_cost_of(fit, relative, seen_with_log(body, readings)) +
                less_for_common_errors(fit, relative, readings);
  a.penalty = penalty_of(fit, readings);
  a.motion_size = motion_size(relative.motion);
  a.fit = std::move(fit);
  return a;
}

}  // namespace kinescope::structure_search
