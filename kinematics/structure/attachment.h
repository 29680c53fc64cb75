// SPDX-License-Identifier: Apache-2.0
//
// Takes   a body, and a link whose path is known.
// Gives   the ways in which the body may hang on the link (rest, turn, slide; by which channels),
// with costs
//         that may be compared between links, since they are all of the same sightings of the body.
#pragma once

#include <optional>
#include <vector>

#include "kinematics/structure/chain.h"
#include "kinematics/structure/readings.h"
#include "kinematics/structure/screening.h"

namespace kinescope::structure_search {

/// Where a link is at every instant, in the camera's frame.
struct LinkPath {
  std::vector<Pose> pose;
  std::vector<char> valid;
  std::vector<Matrix6d> covariance;  ///< right perturbation; empty when the path is exact
  std::vector<double>
      coordinate;  ///< of the joint that leads there, where no channel drives it; NaN unknown
};

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
  double motion_size = 0.0;  ///< RMS of the motion about its mean, m; rotations at a lever of 0.3 m
  std::vector<OrderDoubt> order_doubts;  ///< of joints in series with no marker between them

  [[nodiscard]] bool at_rest() const { return fit.model.joints.empty(); }
  [[nodiscard]] bool driven() const {
    return !at_rest() && !fit.model.joints.front().terms.empty();
  }
  [[nodiscard]] int channel() const {
    return driven() ? fit.model.joints.front().terms.front().channel : -1;
  }
  /// How much of the motion is explained: its size over what is left beyond the noise.
  [[nodiscard]] double explained_ratio() const;
  /// Tempered: errors that are alike in `correlation` neighbouring samples count once.
  [[nodiscard]] double cost(double correlation) const { return data_cost / correlation + penalty; }
};

struct AttachmentOptions {
  bool coordinate_free = true;  ///< joints that no channel drives
  double give_up_above = 0.0;   ///< cost per sighting beyond which nothing is refined; 0: no limit
  int max_refined = 4;
};

/// Motion of the body in the link's frame, and what the link's own doubt adds to the likelihood.
struct RelativeMotion {
  Motion motion;
  double log_det = 0.0;  ///< sum of ln det of the covariances over those of the sightings alone
};
[[nodiscard]] RelativeMotion relative_motion(const Body& body, const LinkPath& path,
                                             const Readings& readings);

/// All looked at, best first (with the correlation of the best).
[[nodiscard]] std::vector<Attachment> find_attachments(const Body& body, int parent,
                                                       const LinkPath& path,
                                                       const Readings& readings,
                                                       const std::vector<char>& usable,
                                                       const AttachmentOptions& options = {});

/// Refits a model on (other) sightings.
[[nodiscard]] Attachment refit(const Attachment& attachment, const Body& body, const LinkPath& path,
                               const Readings& readings);

/// What a body costs that moves freely in the camera's frame.
struct FreeCost {
  double as_seen = 0.0;     ///< a Gaussian with the covariance that the motion happens to have
  double everywhere = 0.0;  ///< as far in every direction as in the mean of all: a free body has no
                            ///< reason to keep to a line
};
[[nodiscard]] FreeCost free_cost(const Body& body, const Readings& readings);

/// The path of the body that hangs on `parent` by this attachment.
[[nodiscard]] LinkPath path_of(const Attachment& attachment, const Body& body,
                               const LinkPath& parent, const Readings& readings);

/// Puts data cost and penalty to a fit.
[[nodiscard]] Attachment attachment_from(ChainFit fit, int parent, const RelativeMotion& relative,
                                         const Body& body, const Readings& readings);

/// The camera itself: at rest at the identity, exact.
[[nodiscard]] LinkPath camera_path(int instants);

/// What is known of a scale before: most logs are in rad or m, some in degrees or millimetres; else
/// any. -2 ln of prior odds and Occam factor for a scale (rad or m per unit of the channel).
/// `si_share`: how likely rad and m are; `rms`: of the readings, since degrees and millimetres come
/// in large numbers.
[[nodiscard]] double scale_penalty(double scale, double sigma, double si_share, double rms);

}  // namespace kinescope::structure_search
