// SPDX-License-Identifier: Apache-2.0
//
// Where a link is over time, and how a body moves as seen from it.
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"
#include "kinematics/structure/readings.h"

namespace kinescope::structure_search {

/// Where a link is at every instant, in the camera's frame.
struct LinkPath {
  std::vector<Pose> pose;
  std::vector<char> valid;
  std::vector<Matrix6d> covariance;  ///< right perturbation; empty when the path is exact
  std::vector<double>
      coordinate;  ///< of the joint that leads there, where no channel drives it; NaN unknown
};

/// The camera itself: at rest at the identity, exact.
[[nodiscard]] LinkPath camera_path(int instants);

/// Motion of the body in the link's frame, and what the link's own doubt adds to the likelihood.
struct RelativeMotion {
  Motion motion;
  double log_det = 0.0;  ///< sum of ln det of the covariances over those of the sightings alone
};
/// With `most` above 0, evenly chosen sightings, at most so many.
[[nodiscard]] RelativeMotion relative_motion(const Body& body, const LinkPath& path,
                                             const Readings& readings, int most = 0);

/// Sightings of the body at instants for which the log has values.
[[nodiscard]] int seen_with_log(const Body& body, const Readings& readings);

}  // namespace kinescope::structure_search
