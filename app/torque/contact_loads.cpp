// SPDX-License-Identifier: Apache-2.0
#include "app/torque/contact_loads.h"

#include <algorithm>
#include <limits>

#include "app/torque/torque_inputs.h"
#include "dynamics/contact/lasting_load.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

void mark_missing(const std::vector<char>& loaded, Eigen::Index joints, MissingTorque& missing) {
  const auto rows = static_cast<Eigen::Index>(loaded.size());
  if (missing.size() == 0) missing = MissingTorque::Constant(rows, joints, false);
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (loaded[static_cast<std::size_t>(row)] != 0) missing.row(row).setConstant(true);
  }
}

}  // namespace

std::vector<TrajectorySpan> loads_in(const TorqueLogReport& log, const DynamicModel& model,
                                     const Eigen::VectorXd& gains,
                                     const ContactCommandOptions& options) {
  TorqueSamples samples;
  try {
    samples = filtered_data(log, options.data.motion).samples;
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return {};
  }
  samples.torque *= gains.cwiseInverse().asDiagonal();
  LastingLoadOptions own;
  own.masses_known = has_masses(model) && samples.torque_unit != "A" && !options.identify;
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  std::vector<TrajectorySpan> out;
  for (const LastingLoad& load : lasting_loads(make_rigid_model(model), samples, own)) {
    for (Eigen::Index row = load.first; row <= load.last; ++row) {
      const bool begins =
          row == load.first || samples.trajectory[row] != samples.trajectory[row - 1];
      if (begins) {
        out.push_back({.trajectory = samples.trajectory_name(samples.trajectory[row]),
                       .begin_s = row == load.first ? samples.t_s[row] : -kEndless});
      }
      // The low-pass needs some of a trajectory's end for itself.
      const bool ends =
          row + 1 == samples.size() || samples.trajectory[row + 1] != samples.trajectory[row];
      out.back().end_s = ends ? kEndless : samples.t_s[row];
    }
  }
  return out;
}

std::vector<char> loaded_rows(const Eigen::VectorXd& t_s, const Eigen::VectorXi& trajectory,
                              const std::vector<std::string>& names,
                              const std::vector<TrajectorySpan>& spans) {
  std::vector<char> out(static_cast<std::size_t>(t_s.size()), 0);
  for (const TrajectorySpan& span : spans) {
    for (Eigen::Index row = 0; row < t_s.size(); ++row) {
      if (names[static_cast<std::size_t>(trajectory[row])] == span.trajectory &&
          t_s[row] >= span.begin_s && t_s[row] <= span.end_s)
        out[static_cast<std::size_t>(row)] = 1;
    }
  }
  return out;
}

TorqueLogReport without_loads(TorqueLogReport log, const std::vector<TrajectorySpan>& spans) {
  TorqueLog& own = log.log;
  mark_missing(loaded_rows(own.t_s, own.trajectory, own.trajectory_names, spans), own.torque.cols(),
               own.torque_missing);
  return log;
}

PredictedLog without_loads(PredictedLog predicted, const std::vector<std::string>& names,
                           const std::vector<TrajectorySpan>& spans) {
  for (TorqueSamples& motion : predicted.motions) {
    mark_missing(loaded_rows(motion.t_s, motion.trajectory, names, spans), motion.joints(),
                 motion.torque_missing);
  }
  return predicted;
}

}  // namespace kinescope
