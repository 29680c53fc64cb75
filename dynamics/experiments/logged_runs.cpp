// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/logged_runs.h"

#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {

TorqueLog log_of_run(const ServoLog& run, const DynamicModel& robot) {
  TorqueLog out;
  out.sources = {"simulated"};
  out.joints = wanted_joints(robot.tree);
  out.t_s = run.samples.t_s;
  out.q = run.samples.q;
  out.torque = run.samples.torque;
  out.dq = out.ddq = Eigen::MatrixXd(out.q.rows(), 0);
  out.trajectory = Eigen::VectorXi::Zero(out.q.rows());
  out.trajectory_names = {"run"};
  out.source.assign(static_cast<std::size_t>(out.q.rows()), 0);
  for (std::size_t i = 0; i < out.source.size(); ++i) out.lines.push_back(i + 2);
  for (const WantedJoint& joint : out.joints) {
    out.q_columns.push_back("q_" + joint.name);
    out.torque_columns.push_back("tau_" + joint.name);
  }
  return out;
}

Motion motion_of_run(const ServoLog& run, const DynamicModel& robot, double cutoff_hz) {
  return derive_motion(log_of_run(run, robot), {.cutoff_hz = cutoff_hz});
}

LearnedTorque learn_effects(const DynamicModel& nominal, const ServoLog& run,
                            const Progress& progress) {
  const Motion motion = motion_of_run(run, nominal);
  TorqueModelOptions options;
  options.keep_saved = true;
  LearnedTorque out;
  out.model =
      *fit_torque_model(TorqueModelKind::kParametric, nominal, motion.samples, options).saved;
  const Motion traced = motion_of_run(run, nominal, tracing_cutoff_hz(motion.cutoff));
  TorqueTraceOptions trace;
  trace.model.filter = {traced.filter, traced.cutoff.cutoff_hz};
  trace.contacts = false;  // nothing touches the robot
  out.traced = trace_torque(nominal, traced.samples, trace, progress).corrected;
  return out;
}

LearnedTorque learn_model(TorqueModelKind kind, const DynamicModel& nominal, const ServoLog& run,
                          int threads, const Progress& progress) {
  TorqueModelOptions options;
  options.keep_saved = true;
  options.threads = threads;
  const Motion motion = motion_of_run(run, nominal);
  const FittedTorqueModel fitted =
      fit_torque_model(kind, nominal, motion.samples, quick_options(options), progress);
  KINESCOPE_CHECK(fitted.saved != nullptr, "a kind that can be saved");
  return {.model = *fitted.saved};
}

}  // namespace kinescope::experiments
