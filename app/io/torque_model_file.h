// SPDX-License-Identifier: Apache-2.0
//
// A learned torque model as a file (app/io/schema/torque_model.schema.json): everything that a
// prediction needs, without the URDF. Numbers read back the same to the last bit.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "dynamics/data/motion.h"
#include "dynamics/effects/trace_torque.h"
#include "dynamics/models/torque_model.h"

namespace kinescope {

/// The parametric model with the effects that tracing found: they have a memory, and need a log.
struct SavedTrace {
  CorrectedTorqueModel corrected;  ///< what prediction needs of it
  TorqueFilter filter;             ///< of the log in which they were found
  Eigen::VectorXd sigma;           ///< one a joint: what they leave of that log
};

struct TorqueModelFile {
  std::string version;  ///< of the program
  SavedTorqueModel model;
  TorqueFilter filter;  ///< of the motion learned from
  MotionSource source = MotionSource::kBest;
  std::optional<SavedTrace> traced;
};

/// Of motions, as the sensors would show them; sigma is what the effects left of the log in which
/// they were found.
[[nodiscard]] TorquePrediction predict_traced_torque(const SavedTrace& traced,
                                                     const TorqueSamples& samples);

[[nodiscard]] std::string torque_model_json(const TorqueModelFile& file);
/// Throws bad_input for what is no such file, or of another version, or does not fit itself.
[[nodiscard]] TorqueModelFile read_torque_model(const std::filesystem::path& path);

}  // namespace kinescope
