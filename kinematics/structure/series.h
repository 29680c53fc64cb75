// SPDX-License-Identifier: Apache-2.0
//
// Takes   PoseTracks. Gives Series: the same sightings cleaned in time, with the noise they really
// have, at no more instants than the search needs. Flips that stand alone in time are swapped for
// their other branch or dropped; neighbouring frames are averaged symmetrically about the instant,
// so that its time stays exact.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "kinematics/structure/pose_tracks.h"

namespace kinescope::structure_search {

/// Noise below this is not believed: interpolation of the log alone is worse (rad, m).
inline constexpr double kNoiseFloor = 2e-6;

/// One pose that a view allows.
struct Branch {
  Pose pose;                                  ///< in the camera's frame
  Matrix6d covariance = Matrix6d::Zero();     ///< right perturbation
  Matrix6d whitening = Matrix6d::Identity();  ///< W with W' W = covariance^-1, upper triangular
};

/// One marker at one instant: the branch that is believed.
struct Sighting : Branch {
  bool seen = false;
  std::optional<Branch> alternative;
  double alternative_cost = 0.0;
};

struct Body {
  TagId id;
  std::vector<Sighting> at;  ///< one an instant
  double noise_scale = 1.0;  ///< noise found over noise declared; already in the covariances
  int seen = 0;              ///< instants with a sighting
};

struct Series {
  std::vector<double> times_s;  ///< of the instants
  std::vector<int> frames;      ///< frame of each instant
  int half_width = 0;           ///< frames averaged on either side
  bool smooth =
      false;  ///< neighbouring frames see nearly the same posture (a video, not a list of stops)
  std::vector<Body> bodies;  ///< by id

  [[nodiscard]] int size() const { return static_cast<int>(times_s.size()); }
};

/// Sets `seen` of every body.
void count_seen(Series& series);

/// Every frame as an instant, cleaned in time, covariances scaled to the noise found.
[[nodiscard]] Series clean_series(const PoseTracks& tracks);

/// At most about `max_instants` instants of a clean series.
[[nodiscard]] Series thinned(const Series& full, int max_instants);

/// From the camera, the median over all sightings of the bodies, m.
[[nodiscard]] double distance_of(std::span<const Body> bodies);

/// W upper triangular with W' W = covariance^-1.
[[nodiscard]] Matrix6d whitening_of(const Matrix6d& covariance);

}  // namespace kinescope::structure_search
