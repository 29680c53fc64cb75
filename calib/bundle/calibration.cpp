// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/calibration.h"

namespace kinescope {

std::string_view to_string(CalibrationStatus status) {
  switch (status) {
    case CalibrationStatus::kNotRun:
      return "not_run";
    case CalibrationStatus::kConverged:
      return "converged";
    case CalibrationStatus::kNotConverged:
      return "not_converged";
    case CalibrationStatus::kUndetermined:
      return "undetermined";
  }
  return "unknown";
}

}  // namespace kinescope
