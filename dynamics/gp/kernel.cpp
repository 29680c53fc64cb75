// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/kernel.h"

#include <cmath>
#include <utility>

#include "dynamics/gp/gram.h"
#include "dynamics/gp/kernel_node.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {

Kernel::Kernel(std::shared_ptr<const KernelNode> node, std::vector<Parameter> parameters)
    : node_(std::move(node)), parameters_(std::move(parameters)) {
  KINESCOPE_CHECK(node_->parameter_count() == static_cast<Eigen::Index>(parameters_.size()),
                  "a kernel and its parameters do not fit");
}

Eigen::VectorXd Kernel::log_values() const {
  Eigen::VectorXd out(static_cast<Eigen::Index>(parameters_.size()));
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    out[static_cast<Eigen::Index>(i)] = std::log(parameters_[i].value);
  }
  return out;
}

Kernel Kernel::with_log_values(const Eigen::VectorXd& log_values) const {
  KINESCOPE_CHECK(log_values.size() == static_cast<Eigen::Index>(parameters_.size()),
                  "one value for each parameter");
  std::vector<Parameter> parameters = parameters_;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    parameters[i].value = std::exp(log_values[static_cast<Eigen::Index>(i)]);
  }
  return {node_, std::move(parameters)};
}

Kernel Kernel::with_parameters(std::vector<Parameter> parameters) const {
  return {node_, std::move(parameters)};
}

Kernel Kernel::held() const {
  std::vector<Parameter> parameters = parameters_;
  for (Parameter& parameter : parameters) parameter.fixed = true;
  return {node_, std::move(parameters)};
}

int Kernel::outputs() const { return node_->outputs(); }
int Kernel::input_columns() const { return node_->input_columns(); }

namespace {

std::vector<Parameter> both(const Kernel& a, const Kernel& b) {
  std::vector<Parameter> out = a.parameters();
  out.insert(out.end(), b.parameters().begin(), b.parameters().end());
  return out;
}

}  // namespace

Kernel operator+(const Kernel& a, const Kernel& b) {
  KINESCOPE_CHECK(a.outputs() == b.outputs(), "kernels with the same number of outputs");
  return {make_sum({a.shared_node(), b.shared_node()}), both(a, b)};
}

Kernel operator*(const Kernel& a, const Kernel& b) {
  KINESCOPE_CHECK(a.outputs() == 1 && b.outputs() == 1, "products are for one output");
  return {make_product({a.shared_node(), b.shared_node()}), both(a, b)};
}

Kernel operator*(double variance, const Kernel& kernel) { return constant(variance) * kernel; }

Kernel linear(FeatureMap map, Offset offset, Weights weights) {
  return polynomial(std::move(map), 1, offset, weights);
}

Kernel constant(double variance) {
  FeatureMap nothing{{}, 0, [](const Inputs&, const Features&) {}};
  Kernel out = polynomial(std::move(nothing), 1, Offset::kFree);
  std::vector<Parameter> parameters = out.parameters();
  parameters[0].name = "scale";
  parameters[0].value = variance;
  return out.with_parameters(std::move(parameters));
}

Kernel multiplicative_polynomial(const FeatureMap& map, int degree, Offset first_offset) {
  KINESCOPE_CHECK(degree >= 1, "a degree of at least 1");
  Kernel out = linear(map, first_offset);
  double start = 1.0;
  for (int k = 1; k < degree; ++k) {
    // Factors that start alike would stay alike: their gradients are the same.
    start *= 0.1;
    Kernel factor = linear(map, Offset::kUnit);
    std::vector<Parameter> parameters = factor.parameters();
    for (Parameter& parameter : parameters) parameter.value = start;
    out = out * factor.with_parameters(std::move(parameters));
  }
  return out;
}

Kernel feature_kernel(FeatureMap map, const Eigen::MatrixXd& sigma) {
  KINESCOPE_CHECK(sigma.rows() == map.size() && sigma.cols() == map.size(),
                  "a covariance for every pair of features");
  const SymmetricEigen eigen = symmetric_eigen(sigma);
  const Eigen::VectorXd& values = eigen.values;
  if (values.size() > 0 && !(values[0] >= -1e-9 * values.cwiseAbs().maxCoeff())) {
    throw bad_request("sigma", "the covariance of the weights has a negative eigenvalue",
                      "give a symmetric positive semi-definite matrix");
  }
  const Eigen::MatrixXd root = eigen.vectors * values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
  Kernel out = linear(mixed(std::move(map), root), Offset::kNone, Weights::kCommon);
  std::vector<Parameter> parameters = out.parameters();
  parameters[0].name = "model scale";
  return out.with_parameters(std::move(parameters));
}

namespace {

void check_inputs(const Kernel& kernel, const Inputs& x) {
  KINESCOPE_CHECK(x.cols() >= kernel.input_columns(), "the inputs have too few columns");
}

}  // namespace

Eigen::MatrixXd covariance(const Kernel& kernel, const Inputs& x, const Inputs& y) {
  check_inputs(kernel, x);
  check_inputs(kernel, y);
  Workers workers;
  const Covariance function(kernel);
  return function.cross(workers, function.prepare(x), function.prepare(y));
}

Eigen::MatrixXd covariance(const Kernel& kernel, const Inputs& x) {
  check_inputs(kernel, x);
  Workers workers;
  const Covariance function(kernel);
  Eigen::MatrixXd out = function.lower(workers, function.prepare(x));
  out.triangularView<Eigen::StrictlyUpper>() = out.transpose();
  return out;
}

Eigen::VectorXd covariance_gradient(const Kernel& kernel, const Inputs& x,
                                    const Eigen::MatrixXd& q) {
  check_inputs(kernel, x);
  Workers workers;
  const Covariance function(kernel);
  return function.contract_lower(workers, function.prepare(x),
                                 [&](Eigen::Index row, Eigen::Index col, Scratch&, Block out) {
                                   out = q.block(row, col, out.rows(), out.cols());
                                 });
}

}  // namespace kinescope::gp
