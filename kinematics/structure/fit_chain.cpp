// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "kinematics/structure/chain_kinematics.h"
#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// Residual of the better branch, whitened, and that branch's penalty.
struct SampleResidual {
  Vector6d white;
  double penalty = 0.0;
};

SampleResidual residual_of(const MotionSample& sample, const ChainKinematics& chain,
                           const double* coordinates) {
  SampleResidual r{sample.whitening * fast_log(chain.left_over(coordinates, sample.pose)), 0.0};
  if (!sample.alternative) return r;
  const Vector6d other =
      sample.whitening * fast_log(chain.left_over(coordinates, *sample.alternative));
  if (other.squaredNorm() + sample.alternative_cost < r.white.squaredNorm()) {
    r.white = other;
    r.penalty = std::max(0.0, sample.alternative_cost);
  }
  return r;
}

// What a model leaves of a motion.
struct Evaluation {
  ResidualParts parts;
  std::vector<Vector6d> white;      // one a sample
  std::vector<Vector6d> axis;       // whitened axis, one a sample (single joint)
  std::vector<double> coordinates;  // samples x joints
};

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

void clear(Evaluation& e, std::size_t samples) {
  e.white.clear();
  e.axis.clear();
  e.white.reserve(samples);
  e.axis.reserve(samples);
  for (auto* part : {&e.parts.along, &e.parts.across, &e.parts.lever, &e.parts.penalty}) {
    part->clear();
    part->reserve(samples);
  }
}

Evaluation evaluate(const Motion& motion, const ChainModel& model,
                    const Eigen::MatrixXd& readings) {
  Evaluation e;
  clear(e, motion.size());
  find_coordinates(motion, model, readings, e.coordinates);
  const ChainKinematics chain(model);
  const std::size_t joints = model.joints.size();
  e.parts.split = joints == 1;
  e.parts.free_axis = is_free(model);
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const SampleResidual r = residual_of(motion[i], chain, e.coordinates.data() + i * joints);
    double along = 0.0;
    if (e.parts.split) {
      e.axis.emplace_back(motion[i].whitening * chain.last_axis());
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

struct Normal {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};

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

// Normal equations of the weighted residuals; of the part along the joint, `axis_weight`.
Normal linearise(const Motion& motion, const ChainModel& model, const Eigen::MatrixXd& readings,
                 double axis_weight, const Evaluation& e, const std::vector<double>& weights) {
  const int size = parameter_count(model);
  const ChainKinematics chain(model);
  const std::size_t joints = model.joints.size();
  const bool reduced = joints == 1 && axis_weight < 1.0;
  const double drop = 1.0 - std::sqrt(axis_weight);
  ChainJacobian J(6, size);
  SquareSum square(size + 1);
  for (std::size_t i = 0; i < motion.size(); ++i) {
    if (weights[i] <= 0.0) continue;
    chain.jacobian(e.coordinates.data() + i * joints, readings, motion[i].instant, J);
    Matrix6d W = std::sqrt(weights[i]) * motion[i].whitening;
    Vector6d white = std::sqrt(weights[i]) * e.white[i];
    if (reduced) {
      const Vector6d u = e.axis[i] / e.parts.lever[i];
      white -= drop * u.dot(white) * u;
      W -= (drop * u) * (u.transpose() * W).eval();
    }
    auto rows = square.next_rows();
    for (Eigen::Index c = 0; c < size - 6; ++c) rows.col(c).noalias() = W * J.col(c);
    rows.middleCols<6>(size - 6) = W;
    rows.col(size) = white;
  }
  const Eigen::MatrixXd sum = std::move(square).sum();
  return {sum.topLeftCorner(size, size), sum.col(size).head(size)};
}

void apply_step(ChainModel& model, const Eigen::VectorXd& step) {
  Eigen::Index column = 0;
  for (ChainJoint& joint : model.joints) {
    Vector6d d = Vector6d::Zero();
    d.head<2>() = step.segment<2>(column);
    if (joint.type == JointType::kRevolute) d.segment<2>(3) = step.segment<2>(column + 2);
    joint.frame = joint.frame * exp_pose(d);
    column += geometry_size(joint.type);
    for (ChainTerm& term : joint.terms) term.scale += step(column++);
  }
  model.mount = model.mount * exp_pose(step.segment<6>(column));
}

// Moves every free coordinate to where its sighting wants it (one Gauss-Newton step).
void update_coordinates(ChainModel& model, const Evaluation& e) {
  const double limit = model.joints.front().type == JointType::kRevolute ? 0.7 : 1e3;
  for (std::size_t i = 0; i < model.coordinates.size(); ++i) {
    model.coordinates[i] += std::clamp(e.parts.along[i] / e.parts.lever[i], -limit, limit);
  }
}

Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& H, double variance) {
  const Eigen::MatrixXd damped =
      H + 1e-9 * Eigen::MatrixXd(H.diagonal().cwiseMax(1e-12).asDiagonal());
  return variance * damped.ldlt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()));
}

std::vector<double> scale_sigmas(const ChainModel& model, const Eigen::MatrixXd& covariance) {
  std::vector<double> sigma;
  Eigen::Index column = 0;
  for (const ChainJoint& joint : model.joints) {
    column += geometry_size(joint.type);
    for (std::size_t t = 0; t < joint.terms.size(); ++t, ++column) {
      sigma.push_back(std::sqrt(std::max(0.0, covariance(column, column))));
    }
  }
  return sigma;
}

void describe(const Motion& motion, const Evaluation& e, const ResidualScale& scale,
              ChainFit& fit) {
  std::vector<double> rotation;
  std::vector<double> translation;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const Vector6d plain = motion[i].whitening.triangularView<Eigen::Upper>().solve(e.white[i]);
    rotation.push_back(plain.head<3>().squaredNorm());
    translation.push_back(plain.tail<3>().squaredNorm());
  }
  // The median of three squared normals of variance 1 is 2.366.
  fit.rotation_rms = std::sqrt(3.0 * median_of(std::move(rotation)) / 2.366);
  fit.translation_rms = std::sqrt(3.0 * median_of(std::move(translation)) / 2.366);
  fit.variance = scale.across;
  fit.raw_variance = scale.raw_across;
  fit.axis_variance = scale.along;
  fit.cost = scale.cost;
  fit.correlation = integrated_autocorrelation(e.white);
}

}  // namespace

ChainFit fit_chain(const Motion& motion, const Eigen::MatrixXd& readings, ChainModel start,
                   const ChainFitOptions& options) {
  ChainFit fit;
  fit.samples = static_cast<int>(motion.size());
  fit.parameters = parameter_count(start);
  const bool free = is_free(start);
  const double axis_weight = free ? 0.0 : options.axis_weight;
  ChainModel model = std::move(start);
  Evaluation e = evaluate(motion, model, readings);
  ResidualScale scale = residual_scale(e.parts, options.outlier_cost);
  double damping = model.joints.size() > 1 ? 1e-3 : 1e-7;
  Normal normal;
  bool moved = true;  // since the last linearisation
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    if (moved) {
      normal = linearise(motion, model, readings, axis_weight, e, robust_weights(e.parts, scale));
    }
    ChainModel next = model;
    Eigen::MatrixXd damped = normal.H;
    damped.diagonal() += damping * normal.H.diagonal().cwiseMax(1e-6);
    const Eigen::VectorXd step = damped.ldlt().solve(normal.g);
    if (!step.allFinite()) break;
    apply_step(next, step);
    if (free) update_coordinates(next, evaluate(motion, next, readings));
    Evaluation e_next = evaluate(motion, next, readings);
    const ResidualScale scale_next = residual_scale(e_next.parts, options.outlier_cost);
    const double gain = scale.cost - scale_next.cost;
    moved = gain > 0.0;
    if (moved) {
      model = std::move(next);
      e = std::move(e_next);
      scale = scale_next;
      damping = std::max(damping * 0.1, 1e-9);
      if (gain < 0.05 + 1e-4 * std::abs(scale.cost)) break;
    } else {
      if (gain > -1e-3 && damping < 1e-2) break;
      damping *= 30.0;
      if (damping > 1e3) break;
    }
  }
  if (normal.H.size() == 0) {
    normal = linearise(motion, model, readings, axis_weight, e, robust_weights(e.parts, scale));
  }
  fit.covariance = covariance_of(normal.H, std::max(scale.across, scale.along));
  fit.scale_sigma = scale_sigmas(model, fit.covariance);
  fit.model = std::move(model);
  describe(motion, e, scale, fit);
  if (options.with_residuals) fit.residuals = std::move(e.white);
  return fit;
}

}  // namespace kinescope::structure_search
