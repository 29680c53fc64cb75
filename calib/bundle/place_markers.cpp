// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/place_markers.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/bundle/hand_eye.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {

using bundle::best_base;
using bundle::fit_mount;
using bundle::hand_eye_cost;
using bundle::HandEyeCost;
using bundle::kClearlyBetter;
using bundle::MountFit;
using bundle::PosePair;

namespace {

std::optional<std::vector<Pose>> links_at(const KinematicTree& tree,
                                          const Eigen::MatrixXd& joint_values, int frame) {
  const Eigen::VectorXd q = joint_values.row(frame);
  if (!q.allFinite()) return std::nullopt;
  return forward_kinematics(tree, q);
}

// A marker and, for every link, its sightings with where the drawing has that link.
struct Sightings {
  TagId id;
  std::vector<std::vector<PosePair>> on_link;
};

std::vector<Sightings> sightings_of(const KinematicTree& nominal,
                                    const Eigen::MatrixXd& joint_values, const PoseTracks& tracks) {
  std::vector<Sightings> out;
  for (const PoseTrack& track : tracks.tracks) {
    Sightings of{track.id, std::vector<std::vector<PosePair>>(nominal.links.size())};
    for (const PoseSample& sample : track.samples) {
      const auto links = links_at(nominal, joint_values, sample.frame);
      if (!links) continue;
      for (std::size_t l = 0; l < links->size(); ++l)
        of.on_link[l].push_back({sample.T_camera_marker, (*links)[l]});
    }
    if (!of.on_link.empty() && !of.on_link[0].empty()) out.push_back(std::move(of));
  }
  return out;
}

struct Choice {
  std::size_t link = 0;
  MountFit fit;
};

// The link of a marker among all; `base_for` gives the base to try it with.
template <typename BaseFor>
Choice choose_link(const Sightings& marker, BaseFor base_for) {
  Choice out;
  out.fit.misfit = std::numeric_limits<double>::infinity();
  for (std::size_t l = marker.on_link.size(); l-- > 0;) {
    const MountFit fit = fit_mount(marker.on_link[l], base_for(marker.on_link[l]));
    if (fit.misfit < kClearlyBetter * out.fit.misfit) out = {l, fit};
  }
  return out;
}

// All markers place the base together, each on its link: what one cannot tell (the side on which a
// hinge's marker has the next axis) another one can. Those that miss by more than the median count
// for less; those that miss by less count alike, since few sightings may fit exactly.
Pose base_of_all(const std::vector<Sightings>& markers, const std::vector<Choice>& choices) {
  std::vector<double> misfits;
  for (const Choice& choice : choices) misfits.push_back(choice.fit.misfit);
  const double typical = std::max(median_of(misfits), std::numeric_limits<double>::epsilon());
  HandEyeCost cost;
  for (std::size_t m = 0; m < markers.size(); ++m) {
    cost.add(hand_eye_cost(markers[m].on_link[choices[m].link]),
             std::pow(typical / std::max(choices[m].fit.misfit, typical), 2));
  }
  return best_base(cost);
}

// Most that the joint values turn (rad) and shift (m) a link.
std::pair<double, double> excursion(const std::vector<PosePair>& pairs) {
  double turn = 0.0;
  double shift = 0.0;
  for (const PosePair& pair : pairs) {
    const Pose move = pairs.front().T_base_link.inverse() * pair.T_base_link;
    turn = std::max(turn, log_rotation(move.rotation).norm());
    shift = std::max(shift, move.translation.norm());
  }
  return {turn, shift};
}

void require_motion(const std::vector<Sightings>& markers, const std::vector<Choice>& choices) {
  // Less motion does not place a base.
  constexpr std::size_t kMinSightings = 3;
  constexpr double kMinTurn = 0.2;    // rad
  constexpr double kMinShift = 0.02;  // m
  for (std::size_t m = 0; m < markers.size(); ++m) {
    const auto& pairs = markers[m].on_link[choices[m].link];
    const auto [turn, shift] = excursion(pairs);
    if (pairs.size() >= kMinSightings && (turn >= kMinTurn || shift >= kMinShift)) return;
  }
  throw undetermined("placing the nominal robot",
                     "no marker is moved by the joints by more than 11 degrees or 20 mm",
                     "record postures in which the joints before a marker move");
}

}  // namespace

Placement place_markers(const KinematicTree& nominal, const Eigen::MatrixXd& joint_values,
                        const PoseTracks& tracks) {
  constexpr int kMaxRounds = 5;
  const std::vector<Sightings> markers = sightings_of(nominal, joint_values, tracks);
  // With a base of its own a marker fits no worse than with the true one: a link that misses even
  // so is none of its.
  std::vector<Choice> choices;
  for (const Sightings& marker : markers) {
    choices.push_back(choose_link(marker, [](const std::vector<PosePair>& pairs) {
      return best_base(hand_eye_cost(pairs));
    }));
  }
  require_motion(markers, choices);
  Placement out;
  for (int round = 0; round < kMaxRounds; ++round) {
    out.T_camera_base = base_of_all(markers, choices);
    bool same = true;
    for (std::size_t m = 0; m < markers.size(); ++m) {
      const Choice choice = choose_link(markers[m], [&](const auto&) { return out.T_camera_base; });
      same = same && choice.link == choices[m].link;
      choices[m] = choice;
    }
    if (same) break;
  }
  for (std::size_t m = 0; m < markers.size(); ++m) {
    out.markers.push_back({markers[m].id, LinkId{static_cast<int>(choices[m].link)},
                           choices[m].fit.T_link_marker, 0.0});
  }
  return out;
}

}  // namespace kinescope
