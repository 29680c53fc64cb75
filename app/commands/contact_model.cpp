// SPDX-License-Identifier: Apache-2.0
#include "app/commands/contact_model.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "app/commands/torque_inputs.h"
#include "dynamics/data/torque_scale.h"
#include "dynamics/identify/consistent_model.h"
#include "dynamics/identify/weighted_fit.h"
#include "dynamics/rigid/inverse_dynamics.h"

namespace kinescope {
namespace {

// Filtered, with what the model's masses predict; nothing of a log that is too short to filter.
struct Predicted {
  TorqueSamples samples;
  Eigen::MatrixXd torque;  // samples x joints
};

std::optional<Predicted> predicted_by(const RigidModel& rigid, const TorqueLogReport& log,
                                      const TorqueDataOptions& options) {
  Predicted out;
  try {
    out.samples = filtered_data(log, options.motion).samples;
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return std::nullopt;
  }
  out.torque = inverse_dynamics_of_samples(rigid, out.samples.q, out.samples.dq, out.samples.ddq);
  return out;
}

// The constant part of what masses leave, beside friction that the model may or may not know; a
// contact does not bend it.
double offset_of(const Predicted& log, Eigen::Index joint, double width) {
  const Eigen::VectorXd dq = log.samples.dq.col(joint);
  Eigen::MatrixXd columns(dq.size(), 3);
  columns << Eigen::VectorXd::Ones(dq.size()), dq, (dq / width).array().tanh().matrix();
  identify::StackedSystem system;
  system.joints = {identify::compact_columns(columns)};
  system.parameters = columns.cols();
  system.torque = log.samples.torque.col(joint) - log.torque.col(joint);
  system.weights = Eigen::MatrixXd::Ones(dq.size(), 1);
  identify::WeightedFitOptions robust;
  robust.loss = RobustLoss::kHuber;
  return weighted_fit(system, robust).parameters[0];
}

ContactModel from_urdf(const ContactCommandOptions& options, const DynamicModel& model,
                       const TorqueLogReport& looked_at, const TorqueLogReport& learn) {
  const RigidModel rigid = make_rigid_model(model);
  std::vector<DriveFriction> friction = friction_of(model);
  std::vector<LogFinding> findings;
  if (const auto log = predicted_by(rigid, looked_at, options.data)) {
    findings = compare_torque_scale(log->samples, log->torque).findings;
    put_into_place(options.logs, findings);
    throw_refusals(findings);
  }
  std::string words = "those of " + options.robot.filename().string();
  if (const auto log = predicted_by(rigid, learn, options.data)) {
    for (std::size_t j = 0; j < friction.size(); ++j) {
      friction[j].offset = offset_of(*log, static_cast<Eigen::Index>(j), friction[j].coulomb_width);
    }
    words += ", torque offsets of the log";
  }
  return {RigidBalance(rigid, friction), Eigen::VectorXd::Ones(rigid.size()), words, findings};
}

ContactModel from_log(const ContactCommandOptions& options, const DynamicModel& model,
                      const TorqueLogReport& learn) {
  const auto& files = options.learn_logs.empty() ? options.logs : options.learn_logs;
  const TorqueData data = filtered_data(learn, options.data.motion);
  // A unit of current is another torque at every drive.
  IdentifyOptions identify;
  identify.gains = data.samples.torque_unit == "A";
  const Identification found = identify_dynamics(model, data.samples, identify);
  const ConsistentModel consistent = consistent_model(found);
  std::vector<DriveFriction> friction = friction_of(consistent.model);
  for (std::size_t k = 0; k < found.terms.size(); ++k) {
    const TorqueTerm& term = found.terms[k];
    if (term.kind == TermKind::kOffset) {
      friction[static_cast<std::size_t>(term.index)].offset =
          consistent.terms[static_cast<Eigen::Index>(k)];
    }
  }
  return {RigidBalance(make_rigid_model(consistent.model), friction),
          found.gains,
          fmt::format("identified from {} samples of {}", data.samples.size(), file_list(files)),
          {}};
}

}  // namespace

ContactModel make_contact_model(const ContactCommandOptions& options, const DynamicModel& model,
                                const TorqueLogReport& looked_at, const TorqueLogReport& learn) {
  if (looked_at.log.torque_unit != learn.log.torque_unit) {
    throw bad_input(
        options.learn_logs.front().string(),
        fmt::format("is in {}, the log in {}", learn.log.torque_unit, looked_at.log.torque_unit),
        "learn from a log of the same signals");
  }
  const bool masses = has_masses(model) && looked_at.log.torque_unit != "A";
  return masses && !options.identify ? from_urdf(options, model, looked_at, learn)
                                     : from_log(options, model, learn);
}

}  // namespace kinescope
