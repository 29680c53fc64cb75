// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/link_evidence.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kSmallestSize = 0.5;
constexpr double kLargestSize = 1000.0;
constexpr int kSizes = 24;

double log_mean_exp(const std::vector<double>& logs) {
  const double largest = *std::ranges::max_element(logs);
  double sum = 0.0;
  for (const double value : logs) sum += std::exp(value - largest);
  return largest + std::log(sum / static_cast<double>(logs.size()));
}

/// Log of the density of the answers under some torque over that under none.
double log_answer_ratio(double squares, int count) {
  std::vector<double> logs;
  for (int i = 0; i < kSizes; ++i) {
    const double size = kSmallestSize * std::pow(kLargestSize / kSmallestSize, (i + 0.5) / kSizes);
    const double variance = 1.0 + size * size;
    logs.push_back(0.5 * squares * (1.0 - 1.0 / variance) - 0.5 * count * std::log(variance));
  }
  return log_mean_exp(logs);
}

/// Probability that a chi-square variable of k degrees of freedom exceeds x. Wilson and Hilferty
/// 1931.
double chi_square_tail(double x, int k) {
  const double c = 2.0 / (9.0 * k);
  const double z = (std::cbrt(x / k) - (1.0 - c)) / std::sqrt(c);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

}  // namespace

Eigen::VectorXd joint_answers(const Eigen::VectorXd& torque, const Eigen::MatrixXd& covariance) {
  // Last joint first: each entry is then cleared of those beyond.
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance.reverse());
  KINESCOPE_CHECK(factor.info() == Eigen::Success, "a positive definite covariance");
  return factor.matrixL().solve(torque.reverse()).reverse();
}

LinkEvidence link_evidence(std::span<const JointAnswers> looks, double level) {
  KINESCOPE_CHECK(!looks.empty(), "at least one look");
  const Eigen::Index n = looks[0].squares.size();
  LinkEvidence out{.probability = Eigen::VectorXd(n), .beyond_p_value = Eigen::VectorXd::Ones(n)};
  bool consistent = true;
  for (Eigen::Index k = n; k-- > 0;) {
    const auto beyond = n - 1 - k;
    for (const JointAnswers& look : looks) {
      if (beyond == 0) break;
      const double p =
          chi_square_tail(look.squares.tail(beyond).sum(), static_cast<int>(beyond) * look.count);
      out.beyond_p_value[k] =
          std::min(out.beyond_p_value[k], static_cast<double>(looks.size()) * p);
    }
    consistent = consistent && out.beyond_p_value[k] >= level;
    if (consistent) out.link = static_cast<int>(k);
  }
  double log_sum = 0.0;
  for (Eigen::Index k = 0; k < n; ++k) {
    std::vector<double> logs;
    for (const JointAnswers& look : looks) {
      logs.push_back(log_answer_ratio(look.squares[k], look.count));
    }
    log_sum += log_mean_exp(logs);
    out.probability[k] = log_sum;
  }
  out.probability = (out.probability.array() - out.probability.maxCoeff()).exp();
  out.probability /= out.probability.sum();
  return out;
}

}  // namespace kinescope
