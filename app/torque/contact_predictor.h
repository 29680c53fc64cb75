// SPDX-License-Identifier: Apache-2.0
//
// Takes   a learned torque model (a file of kinescope dynamics --save-model, or one learned here)
//         and logs of its robot.
// Gives   BalanceSamples of what the model does not predict, for the detector of dynamics/contact.
// Units   those of the model's torque, N m, N or A.
// Method  arXiv 1905.08689: measured minus predicted torque, beside the model's own predictive
//         sigma. Motion goes through the filter of the motion learned from; the torque stays as
//         measured, or a contact would begin before it does.
// Not here: the models (dynamics/models), the detector (dynamics/contact).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/io/torque_model_file.h"
#include "app/torque/torque_options.h"
#include "dynamics/contact/drive_friction.h"
#include "dynamics/data/torque_data.h"

namespace kinescope {

/// What --model asks for.
struct ContactModelChoice {
  std::optional<TorqueModelFile> file;  ///< else one of the kind is to be learned
  TorqueModelKind kind{};
};

/// Throws bad_request for a kind that SavedTorqueModel does not hold, beside --identify and beside
/// another cut-off than the file's; bad_input for what is no model, or that of another robot
/// (joints, geometry). Reads no log.
[[nodiscard]] ContactModelChoice choose_contact_model(const ContactCommandOptions& options,
                                                      const DynamicModel& robot);

/// On the clock of a trajectory.
struct TrajectorySpan {
  std::string trajectory;
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// The kind, learned as `kinescope dynamics` learns within seconds from the samples of the log
/// outside `contacts`.
[[nodiscard]] TorqueModelFile learn_contact_model(TorqueModelKind kind, const DynamicModel& robot,
                                                  const TorqueLogReport& log,
                                                  const std::vector<TrajectorySpan>& contacts,
                                                  const TorqueDataOptions& options);

/// Throws bad_input for torques in another unit than the model's.
void require_unit_of(const TorqueModelFile& file, const TorqueLogReport& log,
                     const std::vector<std::filesystem::path>& files);

/// What the model says of the trajectories of a log that are long enough for its filter.
struct PredictedLog {
  std::vector<TorqueSamples> motions;  ///< as measured
  std::vector<PredictedTorque> torques;
  std::vector<std::string> new_motion;  ///< motion_words(): where the model has not been
};

/// Throws undetermined where no trajectory is long enough, and the refusals of
/// compare_torque_scale.
[[nodiscard]] PredictedLog predict_log(const TorqueModelFile& file, const TorqueLogReport& log,
                                       const std::vector<std::filesystem::path>& files,
                                       const TorqueDataOptions& options);

/// Leaves of the model's inertia what explains the log to learn from (usable_inertia()).
void keep_usable_inertia(const TorqueModelFile& file, PredictedLog& looked_at,
                         std::optional<PredictedLog>& learn);

/// predicted_friction() of the log to learn from, known up to the speeds that the model learned.
[[nodiscard]] std::vector<PredictedFriction> friction_beside(const TorqueModelFile& file,
                                                             const PredictedLog& learn);

}  // namespace kinescope
