// SPDX-License-Identifier: Apache-2.0
//
// Feed-forward of a servo loop by a learned model: torque_controller MODEL.json < motion > torques
// A line of the motion has q, dq, ddq of all joints; one of the torques, mean and half-width.
#include <cstdio>
#include <exception>
#include <vector>

#include "dynamics/control/torque_evaluator.h"

static bool read(std::vector<double>& values) {
  for (double& value : values) {
    if (std::scanf("%lf", &value) != 1) return false;
  }
  return true;
}

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: torque_controller MODEL.json < motion > torques\n");
    return 2;
  }
  try {
    kinescope::TorqueEvaluator model{std::filesystem::path(argv[1])};
    std::vector<double> q(model.joints()), dq = q, ddq = q, torque = q, half_width = q;
    while (read(q) && read(dq) && read(ddq)) {  // nothing below here allocates, throws or locks
      const auto status = model.mean_and_band(q, dq, ddq, torque, half_width);
      if (status != kinescope::TorqueStatus::kDone) return 1;  // a robot would stop
      for (const double value : torque) std::printf("%.17g ", value);
      for (const double value : half_width) std::printf("%.17g ", value);
      std::printf("\n");
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "torque_controller: %s\n", error.what());
    return 3;
  }
  return 0;
}
