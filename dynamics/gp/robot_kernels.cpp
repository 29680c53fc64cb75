// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/robot_kernels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

// Of the weights of a joint's two factors: alike at the start they would stay alike.
constexpr double kFirst = 1.0;
constexpr double kSecond = 0.1;

Kernel renamed(const Kernel& kernel, const std::string& prefix) {
  std::vector<Parameter> parameters = kernel.parameters();
  for (Parameter& parameter : parameters) parameter.name = prefix + " " + parameter.name;
  return kernel.with_parameters(std::move(parameters));
}

// Mean square of every feature over the inputs, averaged over the features.
double mean_square(const FeatureMap& map, const Inputs& inputs) {
  Eigen::MatrixXd features(inputs.rows(), map.size());
  map.map(inputs, features);
  const double square = features.size() > 0 ? features.array().square().mean() : 0.0;
  return square > 0.0 ? square : 1.0;
}

// A linear kernel whose free offset, if it has one, and whose weights start at these values.
Kernel with_start(const Kernel& kernel, Eigen::Index weights, double offset, double weight) {
  std::vector<Parameter> parameters = kernel.parameters();
  const std::size_t offsets = parameters.size() - static_cast<std::size_t>(weights);
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    Parameter& parameter = parameters[p];
    parameter.value = std::clamp(p < offsets ? offset : weight, parameter.lower, parameter.upper);
  }
  return kernel.with_parameters(std::move(parameters));
}

}  // namespace

FeatureMap joint_position(const JointKinds& joints, int joint) {
  KINESCOPE_CHECK(joint >= 0 && joint < static_cast<int>(joints.size()), "no such joint");
  return joints[static_cast<std::size_t>(joint)] == JointKind::kRevolute ? angle(joint)
                                                                         : columns({joint});
}

FeatureMap accelerations_and_velocity_products(int joints) {
  FeatureMap out{{}, 3 * joints, {}};
  for (int i = 0; i < joints; ++i) out.names.push_back(fmt::format("ddq{}", i));
  for (int i = 0; i < joints; ++i) {
    for (int j = i; j < joints; ++j) out.names.push_back(fmt::format("dq{} dq{}", i, j));
  }
  out.map = [joints](const Inputs& inputs, Features features) {
    const Eigen::Index n = joints;
    features.leftCols(n) = inputs.middleCols(2 * n, n);
    Eigen::Index at = joints;
    for (int i = 0; i < joints; ++i) {
      for (int j = i; j < joints; ++j) {
        features.col(at++) = inputs.col(joints + i).cwiseProduct(inputs.col(joints + j));
      }
    }
  };
  return out;
}

Kernel gip(const JointKinds& joints) {
  const int n = static_cast<int>(joints.size());
  KINESCOPE_CHECK(n > 0, "at least one joint");
  return renamed(
      linear(accelerations_and_velocity_products(n)) *
          position_factors(joints, kFirst, kSecond, std::vector<double>(joints.size(), 1.0)),
      "gip");
}

Kernel gip(const JointKinds& joints, const Inputs& inputs) {
  const int n = static_cast<int>(joints.size());
  KINESCOPE_CHECK(n > 0, "at least one joint");
  // A joint's factor is (1 + first weight) (1 + second weight) for features of mean square 1.
  const double factors = std::pow((1.0 + kFirst) * (1.0 + kSecond), n);
  const FeatureMap motion = accelerations_and_velocity_products(n);
  // A point mass at one metre: torque = m (ddq + g cos q).
  constexpr double kGravitySquared = 9.81 * 9.81;
  const double sum = mean_square(motion, inputs) * static_cast<double>(motion.size());
  const double weight = 1.0 / (factors * (kGravitySquared + sum));
  std::vector<double> squares(joints.size(), 1.0);  // cos^2 + sin^2 is 1 as it is
  for (int j = 0; j < n; ++j) {
    const auto at = static_cast<std::size_t>(j);
    if (joints[at] == JointKind::kPrismatic) {
      squares[at] = mean_square(joint_position(joints, j), inputs);
    }
  }
  return renamed(with_start(linear(motion), motion.size(), kGravitySquared * weight, weight) *
                     position_factors(joints, kFirst, kSecond, squares),
                 "gip");
}

Kernel joint_friction(int joints, int joint, double transition_velocity) {
  KINESCOPE_CHECK(joint >= 0 && joint < joints, "no such joint");
  return renamed(linear(friction(joints + joint, transition_velocity), Offset::kNone), "friction");
}

Kernel semi_parametric(FeatureMap model, const Eigen::MatrixXd& sigma, FeatureMap rest) {
  return feature_kernel(std::move(model), sigma) + rbf(std::move(rest));
}

}  // namespace kinescope::gp
