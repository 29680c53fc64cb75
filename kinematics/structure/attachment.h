// SPDX-License-Identifier: Apache-2.0
//
// One way to hang a body on a link (rest, turn, slide, several joints), with what it costs. Costs
// may be compared between links, since they are all of the same sightings of the body.
#pragma once

#include <vector>

#include "kinematics/structure/link_path.h"

namespace kinescope::structure_search {

/// Two joints in series that could as well stand the other way round.
struct OrderDoubt {
  int first = 0;  ///< channels (columns of the readings)
  int second = 0;
  double loss = 0.0;  ///< -2 ln likelihood of the other order over this one
};

/// One way to hang a body on a link.
struct Attachment {
  int parent = 0;  ///< link
  ChainFit fit;
  double data_cost = 0.0;    ///< -2 ln likelihood of the sightings (tempered by nothing)
  double penalty = 0.0;      ///< for parameters, and what is known of scales and sizes before
  double motion_size = 0.0;  ///< RMS of the motion about its mean, m; rotations at kLever
  std::vector<OrderDoubt> order_doubts;  ///< of joints in series with no marker between them

  [[nodiscard]] bool at_rest() const { return fit.model.joints.empty(); }
  [[nodiscard]] bool driven() const {
    return !at_rest() && !fit.model.joints.front().terms.empty();
  }
  [[nodiscard]] int channel() const {
    return driven() ? fit.model.joints.front().terms.front().channel : -1;
  }
  /// Across the joint and along it.
  [[nodiscard]] bool leaves_noise_only() const;
  /// How much of the motion is explained: its size over what is left beyond the noise.
  [[nodiscard]] double explained_ratio() const;
  /// Tempered: errors that are alike in `correlation` neighbouring samples count once.
  [[nodiscard]] double cost(double correlation) const { return data_cost / correlation + penalty; }
};

/// Puts data cost and penalty to a fit.
[[nodiscard]] Attachment attachment_from(ChainFit fit, int parent, const RelativeMotion& relative,
                                         const Body& body, const Readings& readings);

}  // namespace kinescope::structure_search
