// SPDX-License-Identifier: Apache-2.0
//
// The positions' part of a geometrically inspired polynomial: for every map of one or two features
// (1 + a x y) (1 + b x y), multiplied over the maps. As a product of 2 n linear kernels it would go
// through a tile 2 n times for a value and 6 n times for a gradient; here a column of the tile
// stays in the first-level cache while all maps pass over it.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamics/gp/kernel_node.h"
#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/simd.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

// Two features of one map in both factors, times those of one sample: a slide has one feature, and
// its second weights are 0.
struct Slopes {
  double a0, a1, b0, b1;
};

KINESCOPE_WIDE void multiply_factors(const double* x0, const double* x1, Slopes s, Index rows,
                                     double* out) {
  for (Index i = 0; i < rows; ++i) {
    out[i] *= (1.0 + s.a0 * x0[i] + s.a1 * x1[i]) * (1.0 + s.b0 * x0[i] + s.b1 * x1[i]);
  }
}

// sum_i w_i d/d (a0, a1, b0, b1) of the factors' product; w_i becomes w_i times that product.
KINESCOPE_WIDE void contract_factors(const double* x0, const double* x1, Slopes s, Index rows,
                                     double* weights, std::array<double, 4>& sums) {
  constexpr Index kPartialSums = 8;
  double lanes[4][kPartialSums] = {};
  const Index whole = rows / kPartialSums * kPartialSums;
  const auto one = [&](Index i, Index lane) {
    const double first = 1.0 + s.a0 * x0[i] + s.a1 * x1[i];
    const double second = 1.0 + s.b0 * x0[i] + s.b1 * x1[i];
    const double by_first = weights[i] * second;
    const double by_second = weights[i] * first;
    lanes[0][lane] += by_first * x0[i];
    lanes[1][lane] += by_first * x1[i];
    lanes[2][lane] += by_second * x0[i];
    lanes[3][lane] += by_second * x1[i];
    weights[i] = by_first * first;
  };
  for (Index i = 0; i < whole; i += kPartialSums) {
    for (Index lane = 0; lane < kPartialSums; ++lane) one(i + lane, lane);
  }
  for (Index i = whole; i < rows; ++i) one(i, 0);
  for (std::size_t k = 0; k < sums.size(); ++k) {
    sums[k] = 0.0;
    for (const double value : lanes[k]) sums[k] += value;
  }
}

std::shared_ptr<const KernelNode> as_product(const std::vector<FeatureMap>& maps) {
  std::vector<std::shared_ptr<const KernelNode>> factors;
  for (const FeatureMap& map : maps) {
    for (int k = 0; k < 2; ++k) factors.push_back(linear(map, Offset::kUnit).shared_node());
  }
  return make_product(factors);
}

class PositionFactorsNode : public KernelNode {
 public:
  explicit PositionFactorsNode(std::vector<FeatureMap> maps)
      : maps_(std::move(maps)), product_(as_product(maps_)) {
    for (const FeatureMap& map : maps_) {
      KINESCOPE_CHECK(map.size() == 1 || map.size() == 2, "one or two features a position");
      firsts_.push_back(features_);
      features_ += map.size();
      columns_ = std::max(columns_, map.input_columns);
    }
  }

  [[nodiscard]] int input_columns() const override { return columns_; }
  // Of every map the weights of its first factor, then those of its second.
  [[nodiscard]] Index parameter_count() const override { return 2 * features_; }

  void featurise(const Inputs& inputs, Prepared& out) const override {
    out.samples = inputs.rows();
    out.tables.resize(1);
    out.tables[0].resize(inputs.rows(), features_);
    for (std::size_t m = 0; m < maps_.size(); ++m) {
      maps_[m].map(inputs, out.tables[0].middleCols(firsts_[m], maps_[m].size()));
    }
  }
  void rescale(const Theta&, Prepared&) const override {}  // weights go with one of the samples

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                Block out) const override {
    out.setOnes();
    multiply(theta, a, b, scratch, out);
  }

  void multiply(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                Block out) const override {
    const Scratch::Frame frame(scratch);
    const auto x = a.rows(0);
    Eigen::Map<Eigen::MatrixXd> weights = scratch.take(theta.size(), 1);
    weights.col(0) = theta.array().exp();
    for (Index j = 0; j < b.size; ++j) {
      for (std::size_t m = 0; m < maps_.size(); ++m) {
        const double* x0 = x.col(firsts_[m]).data();
        multiply_factors(x0, second(x0, x.outerStride(), m), slopes(weights.data(), b, j, m),
                         a.size, out.col(j).data());
      }
    }
  }

  // With the maps before m multiplied in from the left and those after it from the right.
  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                Gradient gradient) const override {
    const Scratch::Frame frame(scratch);
    const auto count = static_cast<Index>(maps_.size());
    const auto x = a.rows(0);
    Eigen::Map<Eigen::MatrixXd> weights = scratch.take(theta.size(), 1);
    weights.col(0) = theta.array().exp();
    Eigen::Map<Eigen::MatrixXd> left = scratch.take(a.size, count);
    Eigen::Map<Eigen::MatrixXd> right = scratch.take(a.size, 1);
    std::array<double, 4> sums{};
    for (Index j = 0; j < b.size; ++j) {
      left.col(0) = q.col(j);
      const auto x0_of = [&](Index m) {
        return x.col(firsts_[static_cast<std::size_t>(m)]).data();
      };
      for (Index m = 0; m + 1 < count; ++m) {
        const auto at = static_cast<std::size_t>(m);
        left.col(m + 1) = left.col(m);
        multiply_factors(x0_of(m), second(x0_of(m), x.outerStride(), at),
                         slopes(weights.data(), b, j, at), a.size, left.col(m + 1).data());
      }
      right.setOnes();
      for (Index m = count; m-- > 0;) {
        const auto at = static_cast<std::size_t>(m);
        const Slopes s = slopes(weights.data(), b, j, at);
        const double* x1 = second(x0_of(m), x.outerStride(), at);
        left.col(m).array() *= right.col(0).array();
        contract_factors(x0_of(m), x1, s, a.size, left.col(m).data(), sums);
        add_slopes(weights.data(), b, j, at, sums, gradient);
        if (m > 0) multiply_factors(x0_of(m), x1, s, a.size, right.data());
      }
    }
  }

  [[nodiscard]] std::optional<double> feature_count() const override {
    return product_->feature_count();
  }
  [[nodiscard]] Basis basis(const Inputs& inputs) const override { return product_->basis(inputs); }

 private:
  [[nodiscard]] const double* second(const double* x0, Index stride, std::size_t m) const {
    return maps_[m].size() > 1 ? x0 + stride : x0;
  }

  [[nodiscard]] Slopes slopes(const double* weights, const Samples& b, Index j,
                              std::size_t m) const {
    const Index first = firsts_[m];
    const Index size = maps_[m].size();
    const double y0 = b.rows(0)(j, first);
    const double y1 = size > 1 ? b.rows(0)(j, first + 1) : 0.0;
    const Index at = 2 * first;
    return {weights[at] * y0, size > 1 ? weights[at + 1] * y1 : 0.0, weights[at + size] * y0,
            size > 1 ? weights[at + size + 1] * y1 : 0.0};
  }

  // d/dlog w = w d/dw.
  void add_slopes(const double* weights, const Samples& b, Index j, std::size_t m,
                  const std::array<double, 4>& sums, Gradient& gradient) const {
    const Slopes s = slopes(weights, b, j, m);
    const Index size = maps_[m].size();
    const Index at = 2 * firsts_[m];
    gradient[at] += s.a0 * sums[0];
    gradient[at + size] += s.b0 * sums[2];
    if (size == 1) return;
    gradient[at + 1] += s.a1 * sums[1];
    gradient[at + size + 1] += s.b1 * sums[3];
  }

  std::vector<FeatureMap> maps_;
  std::vector<Index> firsts_;
  Index features_ = 0;
  int columns_ = 0;
  std::shared_ptr<const KernelNode> product_;  // the same kernel as a product of linear ones
};

}  // namespace

Kernel position_factors(const JointKinds& joints, double first, double second,
                        const std::vector<double>& mean_squares) {
  std::vector<FeatureMap> maps;
  std::vector<Parameter> parameters;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    maps.push_back(joint_position(joints, static_cast<int>(j)));
    const Kernel factor = linear(maps.back(), Offset::kUnit);
    for (const double share : {first, second}) {
      for (Parameter parameter : factor.parameters()) {
        parameter.value = std::clamp(share / mean_squares[j], parameter.lower, parameter.upper);
        parameters.push_back(std::move(parameter));
      }
    }
  }
  return {std::make_shared<PositionFactorsNode>(std::move(maps)), std::move(parameters)};
}

}  // namespace kinescope::gp
