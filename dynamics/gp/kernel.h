// SPDX-License-Identifier: Apache-2.0
//
// Takes   feature maps of the inputs (samples x columns).
// Gives   Kernel: a covariance function with its parameters, a value that is added and multiplied.
// Units   those of the inputs; parameters are positive and estimated in their logarithm.
// Method  Rasmussen and Williams 2006, chapters 4 and 5; robot kernels in robot_kernels.h and
//         lip_kernel.h. Not here: fitting (gaussian_process.h, hyperparameters.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamics/gp/feature_map.h"

namespace kinescope::gp {

/// A positive number of a model.
struct Parameter {
  std::string name;  ///< "rbf length scale x3"
  double value = 1.0;
  double lower = 1e-4;  ///< range of the search
  double upper = 1e4;
  bool fixed = false;            ///< is left as it is
  double prior_log_sigma = 0.0;  ///< > 0: log-normal prior about `prior_value`
  double prior_value = 1.0;
};

class KernelNode;

/// Covariance function of one or several outputs. A tree that is shared, and the parameters'
/// values.
class Kernel {
 public:
  Kernel(std::shared_ptr<const KernelNode> node, std::vector<Parameter> parameters);

  [[nodiscard]] const std::vector<Parameter>& parameters() const { return parameters_; }
  [[nodiscard]] Eigen::VectorXd log_values() const;
  /// The same function with other values, in the order of `parameters()`.
  [[nodiscard]] Kernel with_log_values(const Eigen::VectorXd& log_values) const;
  /// The same function with other values, ranges and priors.
  [[nodiscard]] Kernel with_parameters(std::vector<Parameter> parameters) const;
  /// None of its parameters is estimated.
  [[nodiscard]] Kernel held() const;
  [[nodiscard]] int outputs() const;
  /// The inputs must have at least so many columns.
  [[nodiscard]] int input_columns() const;
  [[nodiscard]] const KernelNode& node() const { return *node_; }
  [[nodiscard]] const std::shared_ptr<const KernelNode>& shared_node() const { return node_; }

 private:
  std::shared_ptr<const KernelNode> node_;
  std::vector<Parameter> parameters_;
};

[[nodiscard]] Kernel operator+(const Kernel& a, const Kernel& b);
[[nodiscard]] Kernel operator*(const Kernel& a, const Kernel& b);
/// Scaled by a further parameter "scale" that starts at `variance`.
[[nodiscard]] Kernel operator*(double variance, const Kernel& kernel);

enum class LengthScales { kOneEach, kCommon };
enum class Amplitude { kFree, kUnit };
/// v exp(-1/2 sum_d (x_d - y_d)^2 / l_d^2): squared exponential. Length scales start at the root of
/// the number of features.
[[nodiscard]] Kernel rbf(FeatureMap map, LengthScales scales = LengthScales::kOneEach,
                         Amplitude amplitude = Amplitude::kFree);

enum class Offset { kNone, kUnit, kFree };
enum class Weights { kOneEach, kCommon };
/// (o + sum_d w_d x_d y_d)^degree.
[[nodiscard]] Kernel polynomial(FeatureMap map, int degree, Offset offset = Offset::kFree,
                                Weights weights = Weights::kOneEach);
/// o + sum_d w_d x_d y_d.
[[nodiscard]] Kernel linear(FeatureMap map, Offset offset = Offset::kFree,
                            Weights weights = Weights::kOneEach);
/// Product of `degree` linear kernels with their own weights (Dalla Libera and Carli 2020, eq. 10):
/// monomials of degree 1 and of degree 2 are weighted apart. The first factor's offset is free.
[[nodiscard]] Kernel multiplicative_polynomial(const FeatureMap& map, int degree,
                                               Offset first_offset = Offset::kFree);
/// The model-based kernel: w phi(x)' sigma phi(y), features times the covariance of their weights.
[[nodiscard]] Kernel feature_kernel(FeatureMap map, const Eigen::MatrixXd& sigma);
/// The same value everywhere.
[[nodiscard]] Kernel constant(double variance = 1.0);
/// Independent outputs, one kernel for each.
[[nodiscard]] Kernel independent_outputs(const std::vector<Kernel>& kernels);

/// k(x, y) for all pairs; rows and columns are sample-major (sample * outputs + output).
[[nodiscard]] Eigen::MatrixXd covariance(const Kernel& kernel, const Inputs& x, const Inputs& y);
/// The same for x with itself, symmetric to the last bit.
[[nodiscard]] Eigen::MatrixXd covariance(const Kernel& kernel, const Inputs& x);
/// d/d log(parameter) of sum_ij Q_ij k(x_i, x_j) for symmetric Q, at the cost of one covariance.
[[nodiscard]] Eigen::VectorXd covariance_gradient(const Kernel& kernel, const Inputs& x,
                                                  const Eigen::MatrixXd& q);

}  // namespace kinescope::gp
