// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/link_evidence.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kinematics/core/chi_square.h"
#include "kinematics/core/dense_algebra.h"
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

/// The joints between base and link, link included.
std::vector<char> path_to(Eigen::Index link, Eigen::Index joints, std::span<const int> parents) {
  std::vector<char> on(static_cast<std::size_t>(joints), 0);
  for (auto k = static_cast<int>(link); k >= 0;) {
    const auto at = static_cast<std::size_t>(k);
    on[at] = 1;
    k = parents.empty() ? k - 1 : parents[at];
  }
  return on;
}

/// Whitened in the given order: each entry is cleared of those before.
Eigen::VectorXd whitened(const Eigen::VectorXd& torque, const Eigen::MatrixXd& covariance,
                         const Eigen::VectorXi& order) {
  const CholeskyFactor factor(covariance(order, order));
  KINESCOPE_CHECK(factor.positive_definite(), "a positive definite covariance");
  const Eigen::VectorXd white = factor.whitened(torque(order));
  Eigen::VectorXd out(torque.size());
  out(order) = white;
  return out;
}

/// Those that cannot answer first, then from the link towards the base.
Eigen::VectorXi order_for(const std::vector<char>& on_path) {
  Eigen::VectorXi order(static_cast<Eigen::Index>(on_path.size()));
  Eigen::Index place = 0;
  for (const char wanted : {char{0}, char{1}}) {
    for (std::size_t k = on_path.size(); k-- > 0;) {
      if (on_path[k] == wanted) order[place++] = static_cast<int>(k);
    }
  }
  return order;
}

Eigen::RowVectorXd squares_for(const JointAnswers& look, Eigen::Index link) {
  return look.squares.row(look.squares.rows() == 1 ? 0 : link);
}

/// p-value of "no joint off the path answers", the smallest of the looks times their number.
double silence(std::span<const JointAnswers> looks, Eigen::Index link,
               const std::vector<char>& on_path) {
  double out = 1.0;
  for (const JointAnswers& look : looks) {
    const Eigen::RowVectorXd squares = squares_for(look, link);
    double sum = 0.0;
    int joints = 0;
    for (std::size_t i = 0; i < on_path.size(); ++i) {
      if (on_path[i] != 0) continue;
      sum += squares[static_cast<Eigen::Index>(i)];
      ++joints;
    }
    if (joints == 0) break;
    const double p = chi_square_tail(sum, joints * look.count);
    out = std::min(out, static_cast<double>(looks.size()) * p);
  }
  return out;
}

/// Log of how much better "the joints on the path answer something" says the looks than silence.
double log_evidence(std::span<const JointAnswers> looks, Eigen::Index link,
                    const std::vector<char>& on_path) {
  double sum = 0.0;
  for (std::size_t i = 0; i < on_path.size(); ++i) {
    if (on_path[i] == 0) continue;
    std::vector<double> logs;
    for (const JointAnswers& look : looks) {
      logs.push_back(
          log_answer_ratio(squares_for(look, link)[static_cast<Eigen::Index>(i)], look.count));
    }
    sum += log_mean_exp(logs);
  }
  return sum;
}

}  // namespace

bool is_series(std::span<const int> parents) {
  for (std::size_t k = 0; k < parents.size(); ++k) {
    if (parents[k] != static_cast<int>(k) - 1) return false;
  }
  return true;
}

Eigen::MatrixXd joint_answers(const Eigen::VectorXd& torque, const Eigen::MatrixXd& covariance,
                              std::span<const int> parents) {
  const Eigen::Index n = torque.size();
  const Eigen::Index rows = is_series(parents) ? 1 : n;
  Eigen::MatrixXd out(rows, n);
  for (Eigen::Index k = 0; k < rows; ++k) {
    out.row(k) = whitened(torque, covariance, order_for(path_to(k, n, parents)));
  }
  return out;
}

LinkEvidence link_evidence(std::span<const JointAnswers> looks, double level,
                           std::span<const int> parents) {
  KINESCOPE_CHECK(!looks.empty(), "at least one look");
  const Eigen::Index n = looks[0].squares.cols();
  LinkEvidence out{.probability = Eigen::VectorXd(n), .beyond_p_value = Eigen::VectorXd::Ones(n)};
  std::vector<char> possible(static_cast<std::size_t>(n), 1);
  std::ptrdiff_t shortest = n + 1;
  for (Eigen::Index k = n; k-- > 0;) {
    const auto at = static_cast<std::size_t>(k);
    const std::vector<char> on_path = path_to(k, n, parents);
    out.beyond_p_value[k] = silence(looks, k, on_path);
    out.probability[k] = log_evidence(looks, k, on_path);
    if (out.beyond_p_value[k] < level) possible[at] = 0;
    const int parent = parents.empty() ? static_cast<int>(k) - 1 : parents[at];
    if (possible[at] == 0 && parent >= 0) possible[static_cast<std::size_t>(parent)] = 0;
    const std::ptrdiff_t length = std::ranges::count(on_path, char{1});
    if (possible[at] == 0 || length > shortest) continue;
    if (length == shortest && out.probability[k] <= out.probability[out.link]) continue;
    shortest = length;
    out.link = static_cast<int>(k);
  }
  out.probability = (out.probability.array() - out.probability.maxCoeff()).exp();
  out.probability /= out.probability.sum();
  return out;
}

}  // namespace kinescope
