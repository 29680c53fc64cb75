// SPDX-License-Identifier: Apache-2.0
#include "app/torque/torque_robust_stage.h"

#include <memory>

#include <fmt/format.h>

#include "app/torque/torque_inputs.h"
#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

RobustTorqueOptions robust_options(const TorqueModelOptions& options) {
  RobustTorqueOptions out;
  out.drives = options.identify.drives;
  out.threads = options.threads;
  return out;
}

PayloadOptions payload_options(const DynamicsOptions& options) {
  PayloadOptions out;
  out.drives = options.models_options.identify.drives;
  out.link = options.payload_link;
  return out;
}

TorqueScore score_of(const std::shared_ptr<const RobustTorque>& learned, RobustMethod method,
                     const TorqueSamples& test) {
  FittedTorqueModel fitted;
  fitted.samples = static_cast<int>(learned->samples.size());
  fitted.predict = [learned, method](const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                     const Eigen::MatrixXd& ddq) {
    return learned->predict(method, q, dq, ddq);
  };
  return score_torque_model(fitted, test);
}

std::vector<TorquePart> parts_of(const RobustTorque& learned) {
  const TorqueSamples& samples = learned.samples;
  const TorqueSplit split =
      split_torque(learned.fits[static_cast<std::size_t>(RobustMethod::kStudent)], samples.q,
                   samples.dq, samples.ddq, learned.threads);
  const double root = std::sqrt(static_cast<double>(samples.size()));
  std::vector<TorquePart> out;
  for (Eigen::Index j = 0; j < samples.joints(); ++j) {
    out.push_back({.friction_rms = split.friction.col(j).norm() / root,
                   .gravity_rms = split.gravity.col(j).norm() / root,
                   .inertia_rms = split.inertia.col(j).norm() / root,
                   .profile = friction_profile(samples.dq.col(j), split.friction.col(j))});
  }
  return out;
}

}  // namespace

void add_robust_regressions(const DynamicModel& model, const TorqueModelOptions& options,
                            TorqueSummary& summary) {
  try {
    const auto learned = std::make_shared<const RobustTorque>(
        learn_robust_torque(model, summary.train, robust_options(options)));
    RobustSummary out;
    for (const RobustMethod method : kRobustMethods) {
      out.scores.push_back(score_of(learned, method, summary.test));
    }
    out.joints = learned->joints;
    out.folds = learned->folds;
    out.by_trajectory = learned->by_trajectory;
    out.parts = parts_of(*learned);
    summary.robust = std::move(out);
  } catch (const Error& error) {
    summary.warnings.push_back(fmt::format("no robust regression: {}", error.what()));
  }
}

bool asks_for_payload(const DynamicsOptions& options) {
  return options.payload || !options.unloaded_logs.empty();
}

void require_payload_question(const DynamicsOptions& options, const DynamicModel& model,
                              const std::string& torque_unit) {
  if (options.unloaded_logs.empty() && !has_masses(model)) {
    throw bad_request("--payload", "the URDF has no masses to compare with",
                      "name a log of the robot without its load with --unloaded");
  }
  require_payload_question(model, torque_unit, payload_options(options));
}

std::optional<TorqueSamples> add_payload(const DynamicsOptions& options, const DynamicModel& model,
                                         TorqueSummary& summary) {
  const PayloadOptions payload = payload_options(options);
  const TorqueSamples loaded = measured_part(summary.data.samples);
  PayloadSummary out;
  std::optional<TorqueSamples> unloaded;
  if (!options.unloaded_logs.empty()) {
    TorqueDataOptions data = options.data;
    data.motion.cutoff_hz = summary.data.cutoff.cutoff_hz;
    unloaded = measured_part(read_torque_data(recorded::read_channel_tables(options.unloaded_logs),
                                              wanted_joints(model.tree), data)
                                 .samples);
    out.against = "the log without load " + file_list(options.unloaded_logs);
    out.motion = estimate_payload(model, loaded, *unloaded, payload);
  } else {
    out.against = "the masses of " + options.robot.filename().string();
    out.motion = estimate_payload(model, loaded, payload);
  }
  out.by_gains = !options.data.mapping.torque_factor.empty();
  summary.payload = std::move(out);
  return unloaded;
}

void add_payload_at_rest(const DynamicsOptions& options, const DynamicModel& model,
                         const std::optional<TorqueSamples>& unloaded, TorqueSummary& summary) {
  try {
    const RobustTorqueOptions robust = robust_options(options.models_options);
    const RobustTorque with =
        learn_robust_torque(model, measured_part(summary.data.samples), robust);
    std::optional<RobustTorque> without;
    if (unloaded) without = learn_robust_torque(model, *unloaded, robust);
    summary.payload->at_rest =
        payload_at_rest(model, with, without ? &*without : nullptr, payload_options(options));
  } catch (const Error& error) {
    summary.warnings.push_back(fmt::format("no payload at rest: {}", error.what()));
  }
}

}  // namespace kinescope
