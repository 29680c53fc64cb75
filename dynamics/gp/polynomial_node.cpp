// SPDX-License-Identifier: Apache-2.0
//
// (o + sum_d w_d x_d y_d)^p; p = 1 is the linear kernel. With the square roots of the weights
// folded into the features it is one product and a power, and its features are weighted monomials.
#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/gp/kernel_node.h"
#include "dynamics/gp/simd.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

// Up to so many features a product in registers beats a call of BLAS and a second tile.
constexpr Index kFewFeatures = 4;

// out_i *= (offset + sum_d x_id y_d)^degree for one column.
KINESCOPE_WIDE void multiply_column(const double* x, Index stride, Index features, const double* y,
                                    double offset, int degree, Index rows, double* out) {
  const double y0 = features > 0 ? y[0] : 0.0;
  const double y1 = features > 1 ? y[1] : 0.0;
  const double y2 = features > 2 ? y[2] : 0.0;
  const double y3 = features > 3 ? y[3] : 0.0;
  const double* x0 = x;
  const double* x1 = features > 1 ? x + stride : x;
  const double* x2 = features > 2 ? x + 2 * stride : x;
  const double* x3 = features > 3 ? x + 3 * stride : x;
  if (features <= 2 && degree == 1) {
    for (Index i = 0; i < rows; ++i) out[i] *= offset + x0[i] * y0 + x1[i] * y1;
    return;
  }
  for (Index i = 0; i < rows; ++i) {
    const double base = offset + x0[i] * y0 + x1[i] * y1 + x2[i] * y2 + x3[i] * y3;
    double power = base;
    for (int k = 1; k < degree; ++k) power *= base;
    out[i] *= power;
  }
}

// (c + .)^(degree) of a whole column in place.
KINESCOPE_WIDE void raise_column(double offset, int degree, Index rows, double* out) {
  for (Index i = 0; i < rows; ++i) {
    const double base = out[i] + offset;
    double power = degree == 0 ? 1.0 : base;
    for (int k = 1; k < degree; ++k) power *= base;
    out[i] = power;
  }
}

// All exponent vectors of `variables` numbers that add up to `degree`.
void list_exponents(Index variables, int degree, Eigen::VectorXi& current, Index at,
                    std::vector<Eigen::VectorXi>& out) {
  if (at == variables - 1) {
    current[at] = degree;
    out.push_back(current);
    return;
  }
  for (int k = degree; k >= 0; --k) {
    current[at] = k;
    list_exponents(variables, degree - k, current, at + 1, out);
  }
}

double multinomial(const Eigen::VectorXi& exponents) {
  double value = std::lgamma(exponents.sum() + 1.0);
  for (const int k : exponents) value -= std::lgamma(k + 1.0);
  return std::round(std::exp(value));
}

class PolynomialNode : public KernelNode {
 public:
  PolynomialNode(FeatureMap map, int degree, Offset offset, Weights weights)
      : map_(std::move(map)),
        degree_(degree),
        offset_(offset),
        common_(weights == Weights::kCommon) {}

  [[nodiscard]] int input_columns() const override { return map_.input_columns; }
  [[nodiscard]] Index parameter_count() const override {
    return first_weight() + (common_ ? 1 : map_.size());
  }

  // Tables: features times the root of their weights; features as they are.
  void featurise(const Inputs& inputs, Prepared& out) const override {
    out.samples = inputs.rows();
    out.tables.resize(2);
    out.tables[1].resize(inputs.rows(), map_.size());
    map_.map(inputs, out.tables[1]);
  }
  void rescale(const Theta& theta, Prepared& out) const override {
    Eigen::MatrixXd& weighted = out.tables[0];
    weighted.resize(out.samples, map_.size());
    for (Index d = 0; d < map_.size(); ++d) {
      weighted.col(d) = std::exp(0.5 * theta[weight_index(d)]) * out.tables[1].col(d);
    }
  }

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch&, Block out) const override {
    raised(theta, a, b, degree_, out);
  }

  void multiply(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                Block out) const override {
    if (map_.size() > kFewFeatures) {
      KernelNode::multiply(theta, a, b, scratch, out);
      return;
    }
    const auto x = a.rows(0);
    const auto y = b.rows(0);
    double values[kFewFeatures] = {};
    for (Index j = 0; j < b.size; ++j) {
      for (Index d = 0; d < map_.size(); ++d) values[d] = y(j, d);
      // Without features `x` has no storage; the loop then multiplies by the offset alone.
      const double* rows = map_.size() > 0 ? x.data() : out.col(j).data();
      multiply_column(rows, x.outerStride(), map_.size(), values, offset(theta), degree_, a.size,
                      out.col(j).data());
    }
  }

  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                Gradient gradient) const override {
    const Scratch::Frame frame(scratch);
    // dk / d base = p base^(p-1).
    Eigen::Map<Eigen::MatrixXd> m = scratch.take(a.size, b.size);
    if (degree_ == 1) {
      m = q;
    } else {
      raised(theta, a, b, degree_ - 1, m);
      m.array() *= degree_ * q.array();
    }
    if (offset_ == Offset::kFree) gradient[0] += offset(theta) * m.sum();
    if (map_.size() == 0) return;
    Eigen::Map<Eigen::MatrixXd> my = scratch.take(a.size, map_.size());
    product(1.0, m, b.rows(0), 0.0, my);
    for (Index d = 0; d < map_.size(); ++d) {
      gradient[weight_index(d)] += a.rows(0).col(d).dot(my.col(d));
    }
  }

  [[nodiscard]] std::optional<double> feature_count() const override {
    const double variables = static_cast<double>(this->variables());
    double count = 1.0;
    for (int k = 0; k < degree_; ++k) count *= (variables + k) / (k + 1.0);
    return count;
  }

  [[nodiscard]] Basis basis(const Inputs& inputs) const override {
    std::vector<Eigen::VectorXi> terms;
    Eigen::VectorXi current = Eigen::VectorXi::Zero(variables());
    if (variables() > 0) list_exponents(variables(), degree_, current, 0, terms);
    const Eigen::MatrixXd features = map_(inputs);
    const Index first = offset_ == Offset::kNone ? 0 : 1;
    Basis out;
    out.values.resize(inputs.rows(), static_cast<Index>(terms.size()));
    out.exponents = Eigen::MatrixXd::Zero(out.values.cols(), parameter_count());
    for (Index f = 0; f < out.values.cols(); ++f) {
      const Eigen::VectorXi& term = terms[static_cast<std::size_t>(f)];
      auto column = out.values.col(f);
      column.setConstant(std::sqrt(multinomial(term)));
      if (offset_ == Offset::kFree) out.exponents(f, 0) = term[0];
      for (Index d = 0; d < map_.size(); ++d) {
        for (int k = 0; k < term[first + d]; ++k) column.array() *= features.col(d).array();
        out.exponents(f, weight_index(d)) += term[first + d];
      }
    }
    return out;
  }

 private:
  [[nodiscard]] Index first_weight() const { return offset_ == Offset::kFree ? 1 : 0; }
  [[nodiscard]] Index weight_index(Index d) const { return first_weight() + (common_ ? 0 : d); }
  [[nodiscard]] Index variables() const { return map_.size() + (offset_ == Offset::kNone ? 0 : 1); }
  [[nodiscard]] double offset(const Theta& theta) const {
    if (offset_ == Offset::kNone) return 0.0;
    return offset_ == Offset::kUnit ? 1.0 : std::exp(theta[0]);
  }

  void raised(const Theta& theta, Samples a, Samples b, int degree, Block out) const {
    if (map_.size() == 0) {
      out.setZero();
    } else {
      product_transposed(1.0, a.rows(0), b.rows(0), 0.0, out);
    }
    const double o = offset(theta);
    if (degree == 1 && o == 0.0) return;
    for (Index j = 0; j < b.size; ++j) raise_column(o, degree, a.size, out.col(j).data());
  }

  FeatureMap map_;
  int degree_;
  Offset offset_;
  bool common_;
};

}  // namespace

Kernel polynomial(FeatureMap map, int degree, Offset offset, Weights weights) {
  KINESCOPE_CHECK(degree >= 1, "a degree of at least 1");
  std::vector<Parameter> parameters;
  if (offset == Offset::kFree)
    parameters.push_back({.name = "offset", .lower = 1e-8, .upper = 1e6});
  if (weights == Weights::kCommon) {
    parameters.push_back({.name = "weight", .lower = 1e-8, .upper = 1e6});
  } else {
    for (const std::string& name : map.names) {
      parameters.push_back({.name = "weight " + name, .lower = 1e-8, .upper = 1e6});
    }
  }
  return {std::make_shared<PolynomialNode>(std::move(map), degree, offset, weights),
          std::move(parameters)};
}

}  // namespace kinescope::gp
