// SPDX-License-Identifier: Apache-2.0
//
// A torque log as the text of a CSV file: t, q1.., dq1.., ddq1.. (where there are any), tau1...
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "dynamics/data/torque_samples.h"

namespace kinescope {

inline std::string torque_log_csv(const TorqueSamples& samples) {
  std::vector<std::pair<const char*, const Eigen::MatrixXd*>> signals{
      {"q", &samples.q}, {"dq", &samples.dq}, {"ddq", &samples.ddq}, {"tau", &samples.torque}};
  std::erase_if(signals, [](const auto& signal) { return signal.second->size() == 0; });
  std::string text = "t";
  for (const auto& [name, values] : signals) {
    for (Eigen::Index j = 1; j <= values->cols(); ++j) text += fmt::format(",{}{}", name, j);
  }
  text += "\n";
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    text += fmt::format("{}", samples.t_s[i]);
    for (const auto& [name, values] : signals) {
      for (Eigen::Index j = 0; j < values->cols(); ++j) text += fmt::format(",{}", (*values)(i, j));
    }
    text += "\n";
  }
  return text;
}

}  // namespace kinescope
