// SPDX-License-Identifier: Apache-2.0
//
// Nominal robots as trees, from the tables their makers publish.
#pragma once

#include <string>
#include <vector>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope::real {

/// One row of a Denavit-Hartenberg table, m and rad.
struct DhRow {
  double a = 0.0;
  double d = 0.0;
  double alpha = 0.0;
  double theta_offset = 0.0;
};

/// Classic convention (Denavit and Hartenberg 1955): T = Rz(theta) Tz(d) Tx(a) Rx(alpha).
[[nodiscard]] KinematicTree classic_dh(const std::string& name, const std::vector<DhRow>& rows,
                                       const std::vector<std::string>& joints);
/// Modified convention (Craig 1986): T = Rx(alpha) Tx(a) Rz(theta) Tz(d); `flange_d` beyond the
/// last joint.
[[nodiscard]] KinematicTree modified_dh(const std::string& name, const std::vector<DhRow>& rows,
                                        const std::vector<std::string>& joints, double flange_d);
/// Parallel or crossing axes in the base frame at zero: direction and a point of each.
struct ScrewAxis {
  Eigen::Vector3d direction;
  Eigen::Vector3d point;
};
[[nodiscard]] KinematicTree from_screws(const std::string& name, const std::vector<ScrewAxis>& axes,
                                        const std::vector<std::string>& joints);

/// Franka Emika Panda and Research 3 (one published table).
[[nodiscard]] KinematicTree franka(const std::string& name, const std::vector<std::string>& joints);
/// KUKA LBR iiwa 14 R820.
[[nodiscard]] KinematicTree iiwa14(const std::vector<std::string>& joints);
/// Universal Robots UR10 (CB series).
[[nodiscard]] KinematicTree ur10(const std::vector<std::string>& joints);

}  // namespace kinescope::real
