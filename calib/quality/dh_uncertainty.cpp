// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/dh_uncertainty.h"

#include <cmath>
#include <numbers>

#include "calib/bundle/axis_uncertainty.h"

namespace kinescope {
namespace {

constexpr Eigen::Index kStepNumbers = 5;
constexpr Eigen::Index kPoseNumbers = 6;

// Steps one after the other.
Eigen::VectorXd numbers_of(const DhChain& chain) {
  Eigen::VectorXd out(kStepNumbers * std::ssize(chain.steps));
  for (std::size_t k = 0; k < chain.steps.size(); ++k) {
    const DhStep& s = chain.steps[k];
    out.segment<kStepNumbers>(kStepNumbers * static_cast<Eigen::Index>(k)) << s.theta, s.d, s.a,
        s.alpha, s.beta;
  }
  return out;
}

bool is_dh_length(Eigen::Index number) {
  return number % kStepNumbers == 1 || number % kStepNumbers == 2;
}

// By every parameter of the calibration: steps, then base and tool as right perturbations.
Eigen::MatrixXd dh_jacobian(const Calibration& calibration, const DhChain& chain) {
  const Eigen::Index n = kStepNumbers * std::ssize(chain.steps);
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Zero(n + 2 * kPoseNumbers, std::ssize(calibration.parameters));
  for (std::size_t p = 0; p < calibration.parameters.size(); ++p) {
    const Parameter& parameter = calibration.parameters[p];
    const double step = parameter_step(calibration.tree, parameter);
    KinematicTree up = calibration.tree, down = calibration.tree;
    if (!move_robot(up, calibration, parameter, step)) continue;
    static_cast<void>(move_robot(down, calibration, parameter, -step));
    const DhChain above = dh_chain(up, chain), below = dh_chain(down, chain);
    auto column = out.col(static_cast<Eigen::Index>(p));
    column.head(n) = numbers_of(above) - numbers_of(below);
    for (Eigen::Index i = 0; i < n; ++i)
      if (!is_dh_length(i)) column[i] = std::remainder(column[i], 2.0 * std::numbers::pi);
    column.segment<kPoseNumbers>(n) = log_pose(below.base.inverse() * above.base);
    column.tail<kPoseNumbers>() = log_pose(below.tool.inverse() * above.tool);
    column /= 2.0 * step;
  }
  return out;
}

// A joint that no channel drives has no zero of its own: theta, or d, says nothing.
bool has_no_zero(const Joint& joint, Eigen::Index number) {
  return joint.channel.empty() && number == (joint.type == JointType::kRevolute ? 0 : 1);
}

// theta (towards what is hardly apart) and a, and theta behind, which takes the first one back.
bool is_ill_conditioned(const DhChain& chain, std::size_t step, Eigen::Index number) {
  const auto one_line = [&](std::size_t k) { return chain.steps[k].normal == DhNormal::kOneLine; };
  if (one_line(step) && (number == 0 || number == 2)) return true;
  return step > 0 && number == 0 && one_line(step - 1);
}

// Nothing where the data do not determine what it depends on.
Sigma length_of(const Eigen::MatrixXd& J, Eigen::Index row, const Calibration& calibration) {
  for (Eigen::Index i = 0; i < 3; ++i)
    if (number_state(J.row(row + i), calibration) == NumberState::kUndetermined)
      return std::nullopt;
  const auto part = J.middleRows<3>(row);
  return bundle::length_sigma(part * calibration.covariance * part.transpose());
}

}  // namespace

DhUncertainty dh_uncertainty(const Calibration& calibration, const DhChain& chain) {
  const Eigen::MatrixXd J = dh_jacobian(calibration, chain);
  DhUncertainty out;
  out.steps.resize(chain.steps.size());
  for (std::size_t k = 0; k < chain.steps.size(); ++k) {
    for (Eigen::Index i = 0; i < kStepNumbers; ++i) {
      const auto row = J.row(kStepNumbers * static_cast<Eigen::Index>(k) + i);
      DhNumber& number = out.steps[k][static_cast<std::size_t>(i)];
      number.state = number_state(row, calibration);
      if (number.state == NumberState::kHeld) continue;
      if (is_ill_conditioned(chain, k, i)) number.state = NumberState::kUndetermined;
      if (has_no_zero(calibration.tree.joints[chain.joints[k].index()], i))
        number.state = NumberState::kNoChannel;
      if (number.state != NumberState::kEstimated) continue;
      number.sigma = std::sqrt((row * calibration.covariance * row.transpose()).value());
    }
  }
  const Eigen::Index n = kStepNumbers * std::ssize(chain.steps);
  out.base_rotation_rad = length_of(J, n, calibration);
  out.base_translation_m = length_of(J, n + 3, calibration);
  out.tool_rotation_rad = length_of(J, n + kPoseNumbers, calibration);
  out.tool_translation_m = length_of(J, n + kPoseNumbers + 3, calibration);
  // They take back the turn that nearly common lines leave to chance.
  const std::size_t count = chain.steps.size();
  if (count > 0 && chain.steps.front().normal == DhNormal::kOneLine) out.base_rotation_rad.reset();
  if (count > 1 && chain.steps[count - 2].normal == DhNormal::kOneLine)
    out.tool_rotation_rad.reset();
  return out;
}

}  // namespace kinescope
