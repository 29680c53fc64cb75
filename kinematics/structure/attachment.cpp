// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attachment.h"

#include <algorithm>
#include <cmath>

#include "kinematics/structure/attachment_cost.h"

namespace kinescope::structure_search {

double Attachment::explained_ratio() const {
  // A fifth of the noise at least: less cannot be seen.
  const double excess = std::sqrt(std::max(0.04, 1.0 - 1.0 / fit.variance));
  const double left = std::hypot(fit.translation_rms, kLever * fit.rotation_rms) * excess;
  return motion_size / std::max(left, 1e-12);
}

Attachment attachment_from(ChainFit fit, int parent, const RelativeMotion& relative,
                           const Body& body, const Readings& readings) {
  Attachment a;
  a.parent = parent;
  a.data_cost = data_cost_of(fit, relative, seen_with_log(body, readings));
  a.penalty = penalty_of(fit, readings);
  a.motion_size = motion_size(relative.motion);
  a.fit = std::move(fit);
  return a;
}

}  // namespace kinescope::structure_search
