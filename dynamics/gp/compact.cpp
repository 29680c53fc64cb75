// SPDX-License-Identifier: Apache-2.0
//
// Sums run in eight lanes whatever the registers' width, exponentials are made of products and sums
// alone, and the compiler fuses none of them (CMakeLists.txt): a saved model has the same answer on
// every processor.
#include "dynamics/gp/compact.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "dynamics/gp/simd.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

constexpr Index kLanes = 8;
constexpr Index kRows = 256;  // of one pass: its values stay in the first-level cache

// e^x for x <= 0: 2^n e^r with |r| <= ln(2) / 2, Taylor's series to the last bit but one.
inline double exponential(double x) {
  constexpr double kLog2E = 1.4426950408889634;
  constexpr double kLn2High =
      0.693147180369123816490;  // without its last bits: n times it is exact
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: its last bits count units
  constexpr double kLeast = -700.0;              // 1e-304
  x = x > kLeast ? x : kLeast;
  const double shifted = x * kLog2E + kRound;
  const double n = shifted - kRound;
  const double r = (x - n * kLn2High) - n * kLn2Low;
  double sum = 1.0 / 479001600.0;
  sum = sum * r + 1.0 / 39916800.0;
  sum = sum * r + 1.0 / 3628800.0;
  sum = sum * r + 1.0 / 362880.0;
  sum = sum * r + 1.0 / 40320.0;
  sum = sum * r + 1.0 / 5040.0;
  sum = sum * r + 1.0 / 720.0;
  sum = sum * r + 1.0 / 120.0;
  sum = sum * r + 1.0 / 24.0;
  sum = sum * r + 1.0 / 6.0;
  sum = sum * r + 0.5;
  sum = sum * r + 1.0;
  sum = sum * r + 1.0;
  const std::uint64_t power = (std::bit_cast<std::uint64_t>(shifted) + 1023U) << 52U;
  return sum * std::bit_cast<double>(power);
}

// out_i += v exp(-1/2 sum_d (table_id - x_d)^2).
KINESCOPE_WIDE void add_rbf(const double* table, Index stride, Index columns, const double* x,
                            double variance, Index rows, double* out) {
  double squares[kRows];
  for (Index i = 0; i < rows; ++i) squares[i] = 0.0;
  for (Index d = 0; d < columns; ++d) {
    const double* column = table + d * stride;
    const double at = x[d];
    for (Index i = 0; i < rows; ++i) {
      const double difference = column[i] - at;
      squares[i] += difference * difference;
    }
  }
  for (Index i = 0; i < rows; ++i) out[i] += variance * exponential(-0.5 * squares[i]);
}

// out_i = offset + sum_d table_id x_d.
KINESCOPE_WIDE void linear_values(const double* table, Index stride, Index columns, const double* x,
                                  double offset, Index rows, double* out) {
  for (Index i = 0; i < rows; ++i) out[i] = offset;
  for (Index d = 0; d < columns; ++d) {
    const double* column = table + d * stride;
    const double at = x[d];
    for (Index i = 0; i < rows; ++i) out[i] += column[i] * at;
  }
}

// out_i *= (1 + a0 p_i + a1 q_i) (1 + b0 p_i + b1 q_i).
KINESCOPE_WIDE void multiply_position(const double* p, const double* q, double a0, double a1,
                                      double b0, double b1, Index rows, double* out) {
  for (Index i = 0; i < rows; ++i) {
    out[i] *= (1.0 + a0 * p[i] + a1 * q[i]) * (1.0 + b0 * p[i] + b1 * q[i]);
  }
}

KINESCOPE_WIDE double dot(const double* a, const double* b, Index size) {
  double lanes[kLanes] = {};
  const Index whole = size / kLanes * kLanes;
  for (Index i = 0; i < whole; i += kLanes) {
    for (Index lane = 0; lane < kLanes; ++lane) lanes[lane] += a[i + lane] * b[i + lane];
  }
  for (Index i = whole; i < size; ++i) lanes[i - whole] += a[i] * b[i];
  double sum = 0.0;
  for (const double lane : lanes) sum += lane;
  return sum;
}

// out = R k for an upper triangle packed by columns.
KINESCOPE_WIDE void triangle_times(const double* packed, const double* k, Index size, double* out) {
  for (Index i = 0; i < size; ++i) out[i] = 0.0;
  for (Index j = 0; j < size; ++j) {
    const double factor = k[j];
    for (Index i = 0; i <= j; ++i) out[i] += packed[i] * factor;
    packed += j + 1;
  }
}

// One row of position features a joint: (cos, sin) or q.
void position_features(const JointKinds& joints, const double* q, double* out) {
  for (const JointKind kind : joints) {
    if (kind == JointKind::kRevolute) {
      *out++ = std::cos(*q);
      *out++ = std::sin(*q);
    } else {
      *out++ = *q;
    }
    ++q;
  }
}

Index position_count(const JointKinds& joints) {
  const auto turning = std::ranges::count(joints, JointKind::kRevolute);
  return std::ssize(joints) + turning;
}

// ddq, then the products of rates.
void motion_features(const double* motion, Index joints, double* out) {
  for (Index i = 0; i < joints; ++i) *out++ = motion[2 * joints + i];
  for (Index i = 0; i < joints; ++i) {
    for (Index j = i; j < joints; ++j) *out++ = motion[joints + i] * motion[joints + j];
  }
}

Index motion_count(Index joints) { return joints + joints * (joints + 1) / 2; }

void check_parts(const CompactGp& gp, const Eigen::MatrixXd& motions,
                 const Eigen::MatrixXd& features) {
  const CompactKernel& kernel = gp.kernel;
  const auto joints = std::ssize(kernel.gip_joints);
  const Index positions = position_count(kernel.gip_joints);
  const bool gip =
      joints == 0 ||
      (motions.cols() == 3 * joints && kernel.gip_motion.size() == motion_count(joints) &&
       kernel.gip_first.size() == positions && kernel.gip_second.size() == positions);
  const bool rbf = kernel.rbf_rates.size() == 0 || kernel.rbf_rates.size() == motions.cols();
  const bool linear = kernel.linear.size() == features.cols();
  const bool sizes = gp.weights.size() == std::ssize(gp.points) &&
                     gp.root.rows() == gp.root.cols() && gp.root.cols() <= gp.weights.size() &&
                     features.rows() == motions.rows();
  const bool rows = std::ranges::all_of(
      gp.points, [&](int row) { return row >= 0 && row < static_cast<int>(motions.rows()); });
  if (gip && rbf && linear && sizes && rows) return;
  throw bad_request("process", "its kernel, points, weights and variance do not fit each other",
                    "make it with the program that reads it");
}

}  // namespace

CompactPredictor::CompactPredictor(const CompactGp& gp, const Eigen::MatrixXd& motions,
                                   const Eigen::MatrixXd& features)
    : kernel_(gp.kernel), shift_(gp.shift), weights_(gp.weights), carriers_(gp.root.cols()) {
  check_parts(gp, motions, features);
  const auto rows = std::ssize(gp.points);
  const auto joints = std::ssize(kernel_.gip_joints);
  const Eigen::MatrixXd at = motions(gp.points, Eigen::all);
  if (kernel_.rbf_rates.size() > 0) rbf_ = at * kernel_.rbf_rates.asDiagonal();
  scaled_.resize(kernel_.rbf_rates.size());
  motion_features_.resize(joints > 0 ? motion_count(joints) : 0);
  position_features_.resize(position_count(kernel_.gip_joints));
  if (joints > 0) {
    gip_.resize(rows, motion_features_.size());
    positions_.resize(rows, position_features_.size());
    for (Index i = 0; i < rows; ++i) {
      const Eigen::VectorXd own = at.row(i);
      motion_features(own.data(), joints, motion_features_.data());
      position_features(kernel_.gip_joints, own.data(), position_features_.data());
      gip_.row(i) = motion_features_.cwiseProduct(kernel_.gip_motion);
      positions_.row(i) = position_features_;
    }
  }
  const Eigen::MatrixXd own_features = features(gp.points, Eigen::all);
  linear_mean_ = Eigen::VectorXd::Zero(kernel_.linear.size());
  for (Index d = 0; d < linear_mean_.size(); ++d) {
    linear_mean_[d] = kernel_.linear[d] * dot(own_features.col(d).data(), weights_.data(), rows);
  }
  linear_ = own_features.topRows(carriers_) * kernel_.linear.asDiagonal();
  root_.resize(carriers_ * (carriers_ + 1) / 2);
  for (Index j = 0, next = 0; j < carriers_; next += ++j) {
    root_.segment(next, j + 1) = gp.root.col(j).head(j + 1);
  }
  features_.resize(kernel_.linear.size());
  values_.resize(rows);
  carried_.resize(carriers_);
  product_.resize(carriers_);
}

// All but the linear part.
void CompactPredictor::kernel_values(Index begin, Index rows) {
  double* out = values_.data() + begin;
  if (gip_.cols() > 0) {
    linear_values(gip_.data() + begin, gip_.rows(), gip_.cols(), motion_features_.data(),
                  kernel_.gip_offset, rows, out);
    Index at = 0;
    for (const JointKind kind : kernel_.gip_joints) {
      const bool turns = kind == JointKind::kRevolute;
      const double* p = positions_.col(at).data() + begin;
      const double x0 = position_features_[at];
      const double x1 = turns ? position_features_[at + 1] : 0.0;
      multiply_position(p, turns ? p + positions_.rows() : p, kernel_.gip_first[at] * x0,
                        turns ? kernel_.gip_first[at + 1] * x1 : 0.0, kernel_.gip_second[at] * x0,
                        turns ? kernel_.gip_second[at + 1] * x1 : 0.0, rows, out);
      at += turns ? 2 : 1;
    }
  } else {
    std::fill_n(out, rows, 0.0);
  }
  if (rbf_.cols() > 0) {
    add_rbf(rbf_.data() + begin, rbf_.rows(), rbf_.cols(), scaled_.data(), kernel_.rbf_variance,
            rows, out);
  }
}

double CompactPredictor::mean(const Eigen::VectorXd& motion, const Eigen::VectorXd& features) {
  for (Index d = 0; d < scaled_.size(); ++d) scaled_[d] = motion[d] * kernel_.rbf_rates[d];
  if (gip_.cols() > 0) {
    const auto joints = std::ssize(kernel_.gip_joints);
    motion_features(motion.data(), joints, motion_features_.data());
    position_features(kernel_.gip_joints, motion.data(), position_features_.data());
  }
  features_ = features;
  for (Index begin = 0; begin < values_.size(); begin += kRows) {
    kernel_values(begin, std::min(kRows, values_.size() - begin));
  }
  return shift_ + dot(weights_.data(), values_.data(), values_.size()) +
         dot(linear_mean_.data(), features_.data(), features_.size());
}

double CompactPredictor::variance() {
  double prior = kernel_.rbf_rates.size() > 0 ? kernel_.rbf_variance : 0.0;
  if (gip_.cols() > 0) {
    double own = kernel_.gip_offset;
    for (Index d = 0; d < motion_features_.size(); ++d) {
      own += kernel_.gip_motion[d] * motion_features_[d] * motion_features_[d];
    }
    Index at = 0;
    for (const JointKind kind : kernel_.gip_joints) {
      double first = 1.0;
      double second = 1.0;
      for (Index k = 0; k < (kind == JointKind::kRevolute ? 2 : 1); ++k, ++at) {
        const double square = position_features_[at] * position_features_[at];
        first += kernel_.gip_first[at] * square;
        second += kernel_.gip_second[at] * square;
      }
      own *= first * second;
    }
    prior += own;
  }
  for (Index d = 0; d < features_.size(); ++d) {
    prior += kernel_.linear[d] * features_[d] * features_[d];
  }
  linear_values(linear_.data(), linear_.rows(), linear_.cols(), features_.data(), 0.0, carriers_,
                carried_.data());
  for (Index i = 0; i < carriers_; ++i) carried_[i] += values_[i];
  triangle_times(root_.data(), carried_.data(), carriers_, product_.data());
  const double out = prior - dot(product_.data(), product_.data(), carriers_);
  return std::isnan(out) ? std::numeric_limits<double>::infinity() : std::max(0.0, out);
}

}  // namespace kinescope::gp
