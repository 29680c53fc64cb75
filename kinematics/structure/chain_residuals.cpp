// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain_residuals.h"

#include <algorithm>
#include <cmath>

#include "kinematics/structure/chain_kinematics.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// Residual of the better branch, whitened, and that branch's penalty.
struct SampleResidual {
  Vector6d white;
  double penalty = 0.0;
  bool other = false;
};

SampleResidual residual_of(const MotionSample& sample, const ChainKinematics& chain,
                           const double* coordinates) {
  SampleResidual r{sample.whitening * fast_log(chain.left_over(coordinates, sample.pose)), 0.0,
                   false};
  if (!sample.alternative) return r;
  const Vector6d other =
      sample.alternative_whitening * fast_log(chain.left_over(coordinates, *sample.alternative));
  if (other.squaredNorm() + sample.alternative_cost < r.white.squaredNorm()) {
    r = {other, std::max(0.0, sample.alternative_cost), true};
  }
  return r;
}

void find_coordinates(const Motion& motion, const ChainModel& model,
                      const Eigen::MatrixXd& readings, std::vector<double>& out) {
  if (is_free(model)) {
    out = model.coordinates;
    return;
  }
  out.clear();
  for (const MotionSample& sample : motion) {
    for (const ChainJoint& joint : model.joints) {
      out.push_back(chain_coordinate(joint, readings, sample.instant));
    }
  }
}

void clear(ChainResiduals& e, std::size_t samples) {
  e.white.clear();
  e.axis.clear();
  e.white.reserve(samples);
  e.axis.reserve(samples);
  e.other.clear();
  e.other.reserve(samples);
  for (auto* part : {&e.parts.along, &e.parts.across, &e.parts.lever, &e.parts.penalty}) {
    part->clear();
    part->reserve(samples);
  }
}

// Sums A' A over rows that come six at a time: products of many rows at once are what matrix
// kernels are fast at.
class SquareSum {
 public:
  explicit SquareSum(Eigen::Index columns)
      : rows_(6 * kBlock, columns), sum_(Eigen::MatrixXd::Zero(columns, columns)) {}

  [[nodiscard]] auto next_rows() {
    if (used_ == rows_.rows()) flush();
    used_ += 6;
    return rows_.middleRows<6>(used_ - 6);
  }
  [[nodiscard]] Eigen::MatrixXd sum() && {
    flush();
    sum_.triangularView<Eigen::StrictlyUpper>() = sum_.transpose();
    return std::move(sum_);
  }

 private:
  static constexpr Eigen::Index kBlock = 40;

  void flush() {
    sum_.selfadjointView<Eigen::Lower>().rankUpdate(rows_.topRows(used_).transpose());
    used_ = 0;
  }

  Eigen::MatrixXd rows_;
  Eigen::MatrixXd sum_;
  Eigen::Index used_ = 0;
};

}  // namespace

ChainResiduals chain_residuals(const Motion& motion, const ChainModel& model,
                               const Eigen::MatrixXd& readings) {
  ChainResiduals e;
  clear(e, motion.size());
  find_coordinates(motion, model, readings, e.coordinates);
  const ChainKinematics chain(model);
  const std::size_t joints = model.joints.size();
  e.parts.split = joints == 1;
  e.parts.free_axis = is_free(model);
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const SampleResidual r = residual_of(motion[i], chain, e.coordinates.data() + i * joints);
    double along = 0.0;
    e.other.push_back(r.other ? 1 : 0);
    if (e.parts.split) {
      e.axis.emplace_back(whitening_of(motion[i], r.other) * chain.last_axis());
      e.parts.lever.push_back(e.axis.back().norm());
      along = e.axis.back().dot(r.white) / e.parts.lever.back();
    }
    e.white.push_back(r.white);
    e.parts.along.push_back(along);
    e.parts.across.push_back(std::max(0.0, r.white.squaredNorm() - along * along));
    e.parts.penalty.push_back(r.penalty);
  }
  return e;
}

NormalEquations normal_equations(const Motion& motion, const ChainModel& model,
                                 const Eigen::MatrixXd& readings, double axis_weight,
                                 const ChainResiduals& e, const std::vector<double>& weights,
                                 const Eigen::MatrixXd& further) {
  const int size = parameter_count(model);
  const ChainKinematics chain(model);
  const std::size_t joints = model.joints.size();
  const bool reduced = joints == 1 && axis_weight < 1.0;
  const double drop = 1.0 - std::sqrt(axis_weight);
  ChainJacobian J(6, size);
  const Eigen::Index columns = size + (further.cols() > 0 ? 1 : 0);
  SquareSum square(columns + 1);
  for (std::size_t i = 0; i < motion.size(); ++i) {
    if (weights[i] <= 0.0) continue;
    chain.jacobian(e.coordinates.data() + i * joints, readings, motion[i].instant, J);
    Matrix6d W = std::sqrt(weights[i]) * whitening_of(motion[i], e.other[i] != 0);
    Vector6d white = std::sqrt(weights[i]) * e.white[i];
    if (reduced) {
      const Vector6d u = e.axis[i] / e.parts.lever[i];
      white -= drop * u.dot(white) * u;
      W -= (drop * u) * (u.transpose() * W).eval();
    }
    auto rows = square.next_rows();
    for (Eigen::Index c = 0; c < size - 6; ++c) rows.col(c).noalias() = W * J.col(c);
    rows.middleCols<6>(size - 6) = W;
    if (columns > size) rows.col(size).noalias() = W * further.col(static_cast<Eigen::Index>(i));
    rows.col(columns) = white;
  }
  const Eigen::MatrixXd sum = std::move(square).sum();
  return {sum.topLeftCorner(columns, columns), sum.col(columns).head(columns)};
}

}  // namespace kinescope::structure_search
