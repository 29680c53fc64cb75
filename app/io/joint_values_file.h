// SPDX-License-Identifier: Apache-2.0
//
// joint_values.csv of a run folder: where the robot stood in every frame of its recording.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/bundle/calibration.h"

namespace kinescope {

/// `t`, then a column a joint that moves, in the order of the tree: the value of the URDF's joint,
/// rad or m, effects at its encoder included (Calibration::corrected_values); empty where it is not
/// known. `t` in s as in residuals.csv, which has the same first column where there are several
/// cameras or recordings.
[[nodiscard]] std::string joint_values_csv(const Calibration& calibration);

struct JointValues {
  std::vector<double> times_s;  ///< increasing, on the camera's clock
  Eigen::MatrixXd values;       ///< times x joints of the tree; 0 of fixed ones, NaN: not known
};

/// Of the calibration's (reference) camera alone. Throws bad_input: no such file (an earlier
/// version made the run), other columns than the robot has joints, numbers that are none, times
/// that do not increase, no row.
[[nodiscard]] JointValues read_joint_values(const std::filesystem::path& joint_values_csv,
                                            const Calibration& calibration);

}  // namespace kinescope
