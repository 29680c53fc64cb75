// SPDX-License-Identifier: Apache-2.0
//
// Where a link is over time, and how a body moves as seen from it.
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"
#include "kinematics/structure/readings.h"

namespace kinescope::structure_search {

/// 6 x numbers; times its transpose, a covariance.
using DoubtRoot = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Where a link is at every instant, in the camera's frame.
struct LinkPath {
  std::vector<Pose> pose;
  std::vector<char> valid;
  /// Right perturbations. Of the sightings that the path follows, another error at each instant;
  /// empty when the path is exact.
  std::vector<Matrix6d> covariance;
  /// Of the parameters of the joints on the way, which are the same for all instants: what so many
  /// standard normal numbers move the link by. Empty when the path is exact.
  std::vector<DoubtRoot> doubt;
  std::vector<double>
      coordinate;  ///< of the joint that leads there, where no channel drives it; NaN unknown
};

/// The camera itself: at rest at the identity, exact.
[[nodiscard]] LinkPath camera_path(int instants);

/// Motion of the body in the link's frame, and what the link's own doubt adds to the likelihood.
struct RelativeMotion {
  Motion motion;
  double log_det = 0.0;  ///< sum of ln det of the covariances over those of the sightings alone
  /// Samples are whitened as if the parameters of the link's joints erred anew in each. Without
  /// that: whitening, and what the parameters move each sample by; empty where they are exact.
  std::vector<Matrix6d> own_whitening;
  std::vector<DoubtRoot> doubt;
  double doubt_log_det = 0.0;  ///< their part of log_det
};
/// With `most` above 0, evenly chosen sightings, at most so many.
[[nodiscard]] RelativeMotion relative_motion(const Body& body, const LinkPath& path,
                                             const Readings& readings, int most = 0);

/// Sightings of the body at instants for which the log has values.
[[nodiscard]] int seen_with_log(const Body& body, const Readings& readings);

}  // namespace kinescope::structure_search
