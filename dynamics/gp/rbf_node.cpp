// SPDX-License-Identifier: Apache-2.0
//
// Squared exponential. Distances come from one product of scaled features, derivatives by the
// length scales from row and column sums of M = Q o K and one product M X, never from an
// (N, N, D) tensor:
//   sum_ij M_ij (x_id - y_jd)^2 = sum_i r_i x_id^2 + sum_j c_j y_jd^2 - 2 sum_i x_id (M Y)_id.
#include <cmath>
#include <utility>

#include "dynamics/gp/kernel_node.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

class RbfNode : public KernelNode {
 public:
  RbfNode(FeatureMap map, LengthScales scales, Amplitude amplitude)
      : map_(std::move(map)),
        common_(scales == LengthScales::kCommon),
        free_amplitude_(amplitude == Amplitude::kFree) {}

  [[nodiscard]] int input_columns() const override { return map_.input_columns; }
  [[nodiscard]] Index parameter_count() const override {
    return first_scale() + (common_ ? 1 : map_.size());
  }

  // Tables: features / length scale; half of their squared norm; features as they are.
  void featurise(const Inputs& inputs, Prepared& out) const override {
    out.samples = inputs.rows();
    out.tables.resize(3);
    out.tables[2].resize(inputs.rows(), map_.size());
    map_.map(inputs, out.tables[2]);
  }
  void rescale(const Theta& theta, Prepared& out) const override {
    Eigen::MatrixXd& scaled = out.tables[0];
    scaled.resize(out.samples, map_.size());
    for (Index d = 0; d < map_.size(); ++d) {
      scaled.col(d) = std::exp(-theta[scale_index(d)]) * out.tables[2].col(d);
    }
    out.tables[1].resize(out.samples, 1);
    out.tables[1].setZero();
    for (Index d = 0; d < map_.size(); ++d) {
      out.tables[1].col(0).array() += 0.5 * scaled.col(d).array().square();
    }
  }

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch&, Block out) const override {
    const double log_variance = free_amplitude_ ? theta[0] : 0.0;
    const auto half_a = a.rows(1).col(0).array();
    const auto half_b = b.rows(1).col(0).array();
    // Far from the origin (a time stamp, say) the product would lose the distance in rounding.
    constexpr double kFar = 1e5;
    if (half_a.maxCoeff() > kFar && half_b.maxCoeff() > kFar) {
      evaluate_by_differences(log_variance, a, b, out);
      return;
    }
    product_transposed(1.0, a.rows(0), b.rows(0), 0.0, out);
    for (Index j = 0; j < b.size; ++j) {
      // Rounding may leave a squared distance below zero.
      out.col(j).array() =
          ((out.col(j).array() - half_a - half_b[j]).min(0.0) + log_variance).exp();
    }
  }

  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                Gradient gradient) const override {
    const Scratch::Frame frame(scratch);
    Eigen::Map<Eigen::MatrixXd> m = scratch.take(a.size, b.size);
    evaluate(theta, a, b, scratch, m);
    m.array() *= q.array();
    Eigen::Map<Eigen::MatrixXd> sums = scratch.take(a.size, 1);
    sums.setZero();
    // From a sample of the tile as origin, so that sums of squares do not cancel.
    Eigen::Map<Eigen::MatrixXd> x = scratch.take(a.size, map_.size());
    Eigen::Map<Eigen::MatrixXd> y = scratch.take(b.size, map_.size());
    Eigen::Map<Eigen::MatrixXd> my = scratch.take(a.size, map_.size());
    for (Index d = 0; d < map_.size(); ++d) {
      const double origin = a.rows(0)(0, d);
      x.col(d).array() = a.rows(0).col(d).array() - origin;
      y.col(d).array() = b.rows(0).col(d).array() - origin;
    }
    product(1.0, m, y, 0.0, my);
    double total = 0.0;
    for (Index j = 0; j < b.size; ++j) {
      const double c = m.col(j).sum();
      total += c;
      sums.col(0) += m.col(j);
      for (Index d = 0; d < map_.size(); ++d) gradient[scale_index(d)] += c * y(j, d) * y(j, d);
    }
    for (Index d = 0; d < map_.size(); ++d) {
      gradient[scale_index(d)] +=
          (x.col(d).array() * (sums.col(0).array() * x.col(d).array() - 2.0 * my.col(d).array()))
              .sum();
    }
    if (free_amplitude_) gradient[0] += total;
  }

 private:
  void evaluate_by_differences(double log_variance, Samples a, Samples b, Block out) const {
    const auto x = a.rows(0);
    const auto y = b.rows(0);
    for (Index j = 0; j < b.size; ++j) {
      out.col(j).setConstant(log_variance);
      for (Index d = 0; d < map_.size(); ++d) {
        out.col(j).array() -= 0.5 * (x.col(d).array() - y(j, d)).square();
      }
      out.col(j).array() = out.col(j).array().exp();
    }
  }

  [[nodiscard]] Index first_scale() const { return free_amplitude_ ? 1 : 0; }
  [[nodiscard]] Index scale_index(Index d) const { return first_scale() + (common_ ? 0 : d); }

  FeatureMap map_;
  bool common_;
  bool free_amplitude_;
};

}  // namespace

Kernel rbf(FeatureMap map, LengthScales scales, Amplitude amplitude) {
  KINESCOPE_CHECK(map.size() > 0, "at least one feature");
  // Distances of standardised inputs grow with the root of their number; starting shorter, every
  // sample stands alone and the search may take all for noise.
  const double start = std::sqrt(static_cast<double>(map.size()));
  std::vector<Parameter> parameters;
  if (amplitude == Amplitude::kFree) parameters.push_back({.name = "rbf variance"});
  if (scales == LengthScales::kCommon) {
    parameters.push_back({.name = "rbf length scale", .value = start, .lower = 1e-2, .upper = 1e3});
  } else {
    for (const std::string& name : map.names) {
      parameters.push_back(
          {.name = "rbf length scale " + name, .value = start, .lower = 1e-2, .upper = 1e3});
    }
  }
  return {std::make_shared<RbfNode>(std::move(map), scales, amplitude), std::move(parameters)};
}

}  // namespace kinescope::gp
