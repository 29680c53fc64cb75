// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/robot_kernels.h"

#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

Kernel renamed(const Kernel& kernel, const std::string& prefix) {
  std::vector<Parameter> parameters = kernel.parameters();
  for (Parameter& parameter : parameters) parameter.name = prefix + " " + parameter.name;
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
  Kernel out = renamed(linear(accelerations_and_velocity_products(n)), "gip");
  constexpr int kDegree = 2;
  for (int j = 0; j < n; ++j) {
    out =
        out * renamed(multiplicative_polynomial(joint_position(joints, j), kDegree, Offset::kUnit),
                      "gip");
  }
  return out;
}

Kernel joint_friction(int joints, int joint, double transition_velocity) {
  KINESCOPE_CHECK(joint >= 0 && joint < joints, "no such joint");
  return renamed(linear(friction(joints + joint, transition_velocity), Offset::kNone), "friction");
}

Kernel semi_parametric(FeatureMap model, const Eigen::MatrixXd& sigma, FeatureMap rest) {
  return feature_kernel(std::move(model), sigma) + rbf(std::move(rest));
}

}  // namespace kinescope::gp
