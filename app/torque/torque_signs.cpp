// SPDX-License-Identifier: Apache-2.0
#include "app/torque/torque_signs.h"

#include <algorithm>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/torque/torque_inputs.h"
#include "dynamics/data/rough_torque.h"
#include "dynamics/models/turned_torques.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kClearCorrelation = 0.7;  // as in dynamics/data/torque_scale.cpp

void refuse(const std::vector<int>& turned, const TorqueSamples& samples,
            const std::vector<std::filesystem::path>& logs) {
  std::vector<int> factors(static_cast<std::size_t>(samples.joints()), 1);
  std::vector<std::string> names;
  for (const int joint : turned) {
    factors[static_cast<std::size_t>(joint)] = -1;
    names.push_back(samples.joint_names[static_cast<std::size_t>(joint)]);
  }
  const std::string list = fmt::format("[{}]", fmt::join(factors, ", "));
  throw bad_input(
      file_list(logs),
      fmt::format("the torque of {} has the other sign than the other joints'",
                  fmt::join(names, ", ")),
      fmt::format("say so in recording.yaml, dynamics: {{torque_factor: {0}}}, or "
                  "{{position_factor: {0}}} where it is the position that turns the other way",
                  list));
}

/// Offset, viscous and Coulomb friction: N x 3.
Eigen::MatrixXd friction_of(const TorqueSamples& samples, Eigen::Index joint) {
  const double width = std::max(narrow_width(samples.dq.col(joint)), 1e-12);
  Eigen::MatrixXd out(samples.size(), 3);
  out << Eigen::VectorXd::Ones(samples.size()), samples.dq.col(joint),
      (samples.dq.col(joint).array() / width).tanh().matrix();
  return out;
}

/// Correlation of what two columns have beyond the nuisance; 0 where the first has nothing.
double correlation_beyond(const Eigen::MatrixXd& nuisance, const Eigen::VectorXd& expected,
                          const Eigen::VectorXd& measured) {
  constexpr double kNothing = 1e-9;  // of the model's torque
  Eigen::MatrixXd both(expected.size(), 2);
  both << expected, measured;
  const Eigen::MatrixXd rest = both - nuisance * least_squares(nuisance, both);
  if (rest.col(0).norm() <= kNothing * expected.norm()) return 0.0;
  return rest.col(0).dot(rest.col(1)) / (rest.col(0).norm() * rest.col(1).norm());
}

/// Correlation of a joint's torque with the masses' beyond friction and beyond what the last link
/// may carry, which the URDF need not know; 0 where all is that.
double correlation_beyond_load(const RigidModel& rigid, const TorqueSamples& samples,
                               Eigen::Index joint) {
  const Eigen::Index load = 10 * (static_cast<Eigen::Index>(rigid.bodies.size()) - 1);
  const Eigen::MatrixXd regressor = regressors_of_samples(
      rigid, samples.q, samples.dq, samples.ddq)[static_cast<std::size_t>(joint)];
  Eigen::MatrixXd nuisance(samples.size(), 13);
  nuisance << friction_of(samples, joint), regressor.middleCols(load, 10);
  return correlation_beyond(
      nuisance, inverse_dynamics_of_samples(rigid, samples.q, samples.dq, samples.ddq).col(joint),
      samples.torque.col(joint));
}

/// 0 where the samples are too few to say.
double evidence_or_none(const DynamicModel& model, const TorqueSamples& samples,
                        const IdentifyOptions& options, int joint) {
  try {
    return evidence_of_turning(model, samples, options, {joint});
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return 0.0;
  }
}

bool is_sign(const LogFinding& finding) {
  return finding.weight == FaultWeight::kRefusal && finding.fault == LogFault::kTorqueScale &&
         finding.value < 0.0;
}

/// Joints whose torque clearly goes with the inertia of the masses, less those that it goes
/// against, whatever gravity, friction and offset do: gravity may be turned, as in a robot that
/// hangs from the ceiling; inertia is not.
int joints_with_inertia(const RigidModel& rigid, const TorqueSamples& samples) {
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(samples.size(), samples.joints());
  const Eigen::MatrixXd gravity = inverse_dynamics_of_samples(rigid, samples.q, still, still);
  const Eigen::MatrixXd inertia =
      inverse_dynamics_of_samples(rigid, samples.q, samples.dq, samples.ddq) - gravity;
  int out = 0;
  for (Eigen::Index joint = 0; joint < samples.joints(); ++joint) {
    Eigen::MatrixXd nuisance(samples.size(), 4);
    nuisance << friction_of(samples, joint), gravity.col(joint);
    const double correlation =
        correlation_beyond(nuisance, inertia.col(joint), samples.torque.col(joint));
    if (std::abs(correlation) > kClearCorrelation) out += correlation > 0.0 ? 1 : -1;
  }
  return out;
}

/// Most joints against the masses, and against their inertia.
void refuse_where_all_are_turned(const RigidModel& rigid, const TorqueSamples& samples,
                                 const std::vector<std::filesystem::path>& logs,
                                 const TorqueScales& scales) {
  const auto against = std::ranges::count_if(scales.findings, is_sign);
  const auto with = std::ranges::count_if(scales.joints, [](const TorqueScale& scale) {
    return scale.correlation > kClearCorrelation;
  });
  if (against < 2 || against <= with || joints_with_inertia(rigid, samples) >= 0) return;
  const std::vector<int> all(static_cast<std::size_t>(samples.joints()), -1);
  throw bad_input(file_list(logs), "the torques have the other sign than what moves the masses",
                  fmt::format("say so in recording.yaml, dynamics: {{torque_factor: [{}]}}",
                              fmt::join(all, ", ")));
}

}  // namespace

void check_torque_signs(const DynamicModel& model, const TorqueSamples& samples,
                        const IdentifyOptions& options,
                        const std::vector<std::filesystem::path>& logs, TorqueScales& scales) {
  const std::vector<int> turned = find_turned_torques(model, samples, options);
  if (!turned.empty()) refuse(turned, samples, logs);
  const RigidModel rigid = make_rigid_model(model);
  refuse_where_all_are_turned(rigid, samples, logs, scales);
  for (LogFinding& finding : scales.findings) {
    const auto name = std::ranges::find(samples.joint_names, finding.channel);
    if (!is_sign(finding) || name == samples.joint_names.end()) continue;
    const auto joint = static_cast<int>(name - samples.joint_names.begin());
    if (samples.joints() < 2) continue;
    const double evidence = evidence_or_none(model, samples, options, joint);
    const double clear = clear_evidence(samples.joints());
    if (evidence > clear) continue;
    const bool by_the_others = evidence < -clear;
    if (!by_the_others && correlation_beyond_load(rigid, samples, joint) < -kClearCorrelation) {
      continue;
    }
    finding.weight = FaultWeight::kWarning;
    finding.what =
        fmt::format("torque of joint '{}' goes against the masses of the URDF, {}", finding.channel,
                    by_the_others ? "but with the other joints' torques"
                                  : "as it would if the last link carries something");
    finding.remedy = "declare what the robot carries, or correct the masses";
  }
}

}  // namespace kinescope
