// SPDX-License-Identifier: Apache-2.0
//
// A SavedTorqueModel as members of a JSON document (app/io/schema/torque_model.schema.json).
// Numbers read back the same to the last bit. For the files of saved_model_file.h and app/io; not
// installed.
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "dynamics/models/json_reader.h"
#include "dynamics/models/torque_predictor.h"

namespace kinescope {

[[nodiscard]] nlohmann::json list_json(const Eigen::VectorXd& values);
[[nodiscard]] nlohmann::json bodies_json(const RigidModel& rigid);
/// With the schema's name and version; what belongs to the program and its logs is app/io's.
[[nodiscard]] nlohmann::json saved_model_json(const SavedTorqueModel& model);

/// Of `bodies` and `gravity_m_s2`.
[[nodiscard]] RigidModel rigid_of(const nlohmann::json& object, const JsonReader& read);
/// A document of this schema and version, whatever else is in it; throws bad_input.
[[nodiscard]] nlohmann::json torque_model_document(const std::filesystem::path& path,
                                                   const JsonReader& read);
/// One that predicts; throws bad_input.
[[nodiscard]] SavedTorqueModel saved_model_of(const nlohmann::json& document,
                                              const JsonReader& read);

}  // namespace kinescope
