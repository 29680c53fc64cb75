// SPDX-License-Identifier: Apache-2.0
//
// Measured torque logs of others, filtered and split as a first look at them was.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/identify.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

struct TorqueSet {
  std::string name;
  std::string split;
  std::string first_fit;  ///< nMSE per joint, %
  DynamicModel model = {};
  TorqueSamples train = {};
  TorqueSamples test = {};
  IdentifyOptions options = {};
};

struct NamedTorqueSet {
  std::string name;
  std::string folder;  ///< below the shared data
  std::function<TorqueSet(const std::filesystem::path&)> make;
};

[[nodiscard]] const std::vector<NamedTorqueSet>& torque_sets();

}  // namespace kinescope
