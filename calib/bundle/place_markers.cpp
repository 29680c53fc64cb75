// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/place_markers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "calib/bundle/hand_eye.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope {

using bundle::best_base;
using bundle::fit_mount;
using bundle::hand_eye_cost;
using bundle::HandEyeCost;
using bundle::MountFit;
using bundle::PosePair;

namespace {

std::optional<std::vector<Pose>> links_at(const KinematicTree& tree,
                                          const Eigen::MatrixXd& joint_values, int frame) {
  const Eigen::VectorXd q = joint_values.row(frame);
  if (!q.allFinite()) return std::nullopt;
  return forward_kinematics(tree, q);
}

// A marker on an inner link misses by the motion of the joints behind that link, which is large;
// errors of the nominal robot alone can make an inner link fit a little better. So the outermost
// link stays unless another one's misfit is below this share of its own.
constexpr double kClearlyBetter = 0.8;

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

namespace {

struct PointPair {
  const PointObservation* observation = nullptr;
  Pose T_base_link;
};

// Points held in sockets: R x + t = s is linear in the point x and the sockets s.
std::pair<Eigen::Vector3d, double> point_in_targets(const std::vector<PointPair>& pairs) {
  std::map<std::string, int> targets;
  for (const PointPair& pair : pairs) targets.try_emplace(pair.observation->target, 0);
  int next = 3;
  for (auto& [name, column] : targets) {
    column = next;
    next += 3;
  }
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(pairs.size()), next);
  Eigen::VectorXd b(A.rows());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto row = 3 * static_cast<Eigen::Index>(i);
    A.block<3, 3>(row, 0) = pairs[i].T_base_link.matrix3();
    A.block<3, 3>(row, targets[pairs[i].observation->target]) = -Eigen::Matrix3d::Identity();
    b.segment<3>(row) = -pairs[i].T_base_link.translation;
  }
  const Eigen::VectorXd solution = shortest_least_squares(A, b);
  return {solution.head<3>(),
          std::sqrt((A * solution - b).squaredNorm() / static_cast<double>(pairs.size()))};
}

// Umeyama 1991, eqs. 40 to 42, without scale.
Pose absolute_orientation(const std::vector<PointPair>& pairs, const Eigen::Vector3d& point) {
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(pairs.size()));
  Eigen::Matrix3Xd to(3, from.cols());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i].T_base_link * point;
    to.col(static_cast<Eigen::Index>(i)) = *pairs[i].observation->position_m;
  }
  const Eigen::Vector3d from_mean = from.rowwise().mean();
  const Eigen::Vector3d to_mean = to.rowwise().mean();
  const Eigen::Matrix3d R =
      nearest_rotation((to.colwise() - to_mean) * (from.colwise() - from_mean).transpose() /
                       static_cast<double>(pairs.size()));
  return {Eigen::Quaterniond(R).normalized(), to_mean - R * from_mean};
}

struct PointFit {
  Pose T_camera_base;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double rms_m = std::numeric_limits<double>::infinity();
};

// Root mean square distance between where the point was measured and where it should be.
double point_rms(const PointFit& fit, const std::vector<PointPair>& pairs) {
  double sum = 0.0;
  for (const PointPair& pair : pairs) {
    sum += (fit.T_camera_base * (pair.T_base_link * fit.point) - *pair.observation->position_m)
               .squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

// One step of Levenberg and Marquardt on the base's pose and the point together.
PointFit step(const PointFit& fit, const std::vector<PointPair>& pairs, double damping) {
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(9, 9);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(9);
  const Eigen::Matrix3d R = fit.T_camera_base.matrix3();
  for (const PointPair& pair : pairs) {
    const Eigen::Vector3d p_base = pair.T_base_link * fit.point;
    Eigen::Matrix<double, 3, 9> J;
    J << -R * skew(p_base), R, R * pair.T_base_link.matrix3();
    const Eigen::Vector3d missing = *pair.observation->position_m - fit.T_camera_base * p_base;
    normal += J.transpose() * J;
    right += J.transpose() * missing;
  }
  normal.diagonal() *= 1.0 + damping;
  const Eigen::VectorXd d = solve_symmetric(normal, right);
  return {fit.T_camera_base * exp_pose(d.head<6>()), fit.point + d.tail<3>(), 0.0};
}

// A tool that keeps its orientation hardly shows where the point is on its link, and alternation
// all but stops long before the best fit.
PointFit refine(PointFit fit, const std::vector<PointPair>& pairs) {
  constexpr int kMaxSteps = 50;
  double damping = 1e-4;
  for (int i = 0; i < kMaxSteps; ++i) {
    PointFit next = step(fit, pairs, damping);
    next.rms_m = point_rms(next, pairs);
    if (!(next.rms_m < fit.rms_m)) {
      damping *= 10.0;
      continue;
    }
    const bool settled = fit.rms_m - next.rms_m < 1e-9;
    fit = next;
    damping *= 0.1;
    if (settled) break;
  }
  return fit;
}

// Alternates the base's pose with the point's place on its link until neither moves much, then
// refines both.
PointFit fit_point(const std::vector<PointPair>& pairs) {
  constexpr int kMaxRounds = 100;
  PointFit fit;
  for (int round = 0; round < kMaxRounds; ++round) {
    fit.T_camera_base = absolute_orientation(pairs, fit.point);
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (const PointPair& pair : pairs) {
      const Pose T_camera_link = fit.T_camera_base * pair.T_base_link;
      place += T_camera_link.inverse() * *pair.observation->position_m /
               static_cast<double>(pairs.size());
    }
    const double before = fit.rms_m;
    fit.point = place;
    fit.rms_m = point_rms(fit, pairs);
    if (before - fit.rms_m < 1e-9 && round > 10) break;
  }
  return refine(fit, pairs);
}

std::vector<PointPair> point_pairs(const KinematicTree& nominal,
                                   const Eigen::MatrixXd& joint_values,
                                   const PointObservations& points, TagId id, LinkId link) {
  std::vector<PointPair> pairs;
  for (const PointObservation& observation : points.observations) {
    if (observation.id != id) continue;
    if (const auto links = links_at(nominal, joint_values, observation.frame)) {
      pairs.push_back({&observation, (*links)[link.index()]});
    }
  }
  return pairs;
}

bool carries_links(const KinematicTree& tree, LinkId link) {
  return std::ranges::any_of(tree.joints, [&](const Joint& joint) {
    return joint.parent == link && joint.type != JointType::kFixed;
  });
}

}  // namespace

Placement place_points(const KinematicTree& nominal, const Eigen::MatrixXd& joint_values,
                       const PointObservations& points) {
  std::vector<TagId> ids;
  bool measured = false;
  for (const PointObservation& observation : points.observations) {
    if (std::ranges::find(ids, observation.id) == ids.end()) ids.push_back(observation.id);
    measured = measured || observation.position_m.has_value();
  }
  std::ranges::sort(ids);
  Placement out;
  double best_base = std::numeric_limits<double>::infinity();
  for (const TagId id : ids) {
    Marker marker{id, LinkId{0}, {}, 0.0};
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t l = nominal.links.size(); l-- > 1;) {
      const LinkId link{static_cast<int>(l)};
      // A point on an inner joint's axis rests whatever the joints do: sockets alone would always
      // choose it.
      if (!measured && carries_links(nominal, link)) continue;
      const auto pairs = point_pairs(nominal, joint_values, points, id, link);
      if (pairs.size() < 4) continue;
      PointFit fit;
      if (measured) {
        fit = fit_point(pairs);
      } else {
        std::tie(fit.point, fit.rms_m) = point_in_targets(pairs);
      }
      if (fit.rms_m >= kClearlyBetter * least) continue;
      least = fit.rms_m;
      marker.link = link;
      marker.T_link_marker.translation = fit.point;
      if (measured && fit.rms_m < best_base) out.T_camera_base = fit.T_camera_base;
    }
    if (!std::isfinite(least)) continue;
    best_base = std::min(best_base, least);
    out.markers.push_back(marker);
  }
  if (out.markers.empty()) {
    throw undetermined("placing the nominal robot", "fewer than four postures with a point",
                       "record more postures");
  }
  return out;
}

}  // namespace kinescope
