// SPDX-License-Identifier: Apache-2.0
//
// Loads that last in a log (dynamics/contact/lasting_load.h), by the names and clocks of its
// trajectories: contact detection must learn nothing from where they act.
#pragma once

#include <string>
#include <vector>

#include "app/torque/contact_predictor.h"
#include "app/torque/torque_options.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// One a load and trajectory. `gains`: one a joint, measured = gain * torque. None in a log that is
/// too short to filter.
[[nodiscard]] std::vector<TrajectorySpan> loads_in(const TorqueLogReport& log,
                                                   const DynamicModel& model,
                                                   const Eigen::VectorXd& gains,
                                                   const ContactCommandOptions& options);

/// 1 for the rows within the spans: rows of a log or of some of its trajectories, `names` the
/// log's.
[[nodiscard]] std::vector<char> loaded_rows(const Eigen::VectorXd& t_s,
                                            const Eigen::VectorXi& trajectory,
                                            const std::vector<std::string>& names,
                                            const std::vector<TrajectorySpan>& spans);

/// As if no torque had been measured within the spans.
[[nodiscard]] TorqueLogReport without_loads(TorqueLogReport log,
                                            const std::vector<TrajectorySpan>& spans);
[[nodiscard]] PredictedLog without_loads(PredictedLog predicted,
                                         const std::vector<std::string>& names,
                                         const std::vector<TrajectorySpan>& spans);

}  // namespace kinescope
