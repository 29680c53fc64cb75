// SPDX-License-Identifier: Apache-2.0
//
// Whether a found structure is the true one, in terms that do not depend on numbering.
#pragma once

#include <map>
#include <vector>

#include "kinematics/structure/structure.h"
#include "tests/experiments/anchor_2019.h"
#include "tests/truth/random_robot.h"

namespace kinescope {

/// One joint: its links in the numbering of the truth, and what drives it.
struct TrueEdge {
  int parent = 0;
  int child = 0;
  JointType type = JointType::kRevolute;
  int channel = 0;
  auto operator<=>(const TrueEdge&) const = default;
};

/// Sorted.
[[nodiscard]] std::vector<TrueEdge> true_edges(const RandomRobot& robot,
                                               const RobotRecording& recording);
[[nodiscard]] std::map<TagId, int> link_of_tags(const RandomRobot& robot);

/// Every marker on its link, every joint with its type, its neighbours and its main channel. Two
/// slides in series without a marker between are right in either order: they move the same.
[[nodiscard]] bool is_right(const Structure& found, const RandomRobot& robot,
                            const RobotRecording& recording);
[[nodiscard]] bool is_right(const std::vector<AnchorEdge>& found, const RandomRobot& robot,
                            const RobotRecording& recording);

/// What was found beside the truth, several lines.
void print_structure(const Structure& found, const RandomRobot& robot,
                     const RobotRecording& recording);

}  // namespace kinescope
