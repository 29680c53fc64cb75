// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "calib/bundle/place_markers.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope {

using bundle::kClearlyBetter;

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

// A point where all its sightings put it on average.
PointFit point_beside(const Pose& T_camera_base, const std::vector<PointPair>& pairs) {
  PointFit out{T_camera_base};
  for (const PointPair& pair : pairs) {
    const Pose T_camera_link = T_camera_base * pair.T_base_link;
    out.point +=
        T_camera_link.inverse() * *pair.observation->position_m / static_cast<double>(pairs.size());
  }
  out.rms_m = point_rms(out, pairs);
  return out;
}

// Alternates the base's pose with the point's place on its link until neither moves much, then
// refines both.
PointFit fit_point(const std::vector<PointPair>& pairs) {
  constexpr int kMaxRounds = 100;
  PointFit fit;
  for (int round = 0; round < kMaxRounds; ++round) {
    const double before = fit.rms_m;
    fit = point_beside(absolute_orientation(pairs, fit.point), pairs);
    if (before - fit.rms_m < 1e-9 && round > 10) break;
  }
  return refine(fit, pairs);
}

// Where every link is at each frame; empty where a joint value is unknown.
std::vector<std::vector<Pose>> links_at_frames(const KinematicTree& nominal,
                                               const Eigen::MatrixXd& joint_values) {
  std::vector<std::vector<Pose>> out;
  for (Eigen::Index f = 0; f < joint_values.rows(); ++f) {
    const Eigen::VectorXd q = joint_values.row(f);
    out.push_back(q.allFinite() ? forward_kinematics(nominal, q) : std::vector<Pose>{});
  }
  return out;
}

// A point and, for every link, its sightings with where the drawing has that link.
struct PointSightings {
  TagId id;
  std::vector<std::vector<PointPair>> on_link;
};

std::vector<PointSightings> sightings_of(const KinematicTree& nominal,
                                         const Eigen::MatrixXd& joint_values,
                                         const PointObservations& points) {
  constexpr std::size_t kFewest = 4;
  const auto links = links_at_frames(nominal, joint_values);
  std::map<TagId, PointSightings> by_id;
  for (const PointObservation& observation : points.observations) {
    const std::vector<Pose>& at = links[static_cast<std::size_t>(observation.frame)];
    if (at.empty()) continue;
    PointSightings& of = by_id[observation.id];
    of.id = observation.id;
    of.on_link.resize(at.size());
    for (std::size_t l = 0; l < at.size(); ++l) of.on_link[l].push_back({&observation, at[l]});
  }
  std::vector<PointSightings> out;
  for (auto& [id, of] : by_id)
    if (of.on_link.front().size() >= kFewest) out.push_back(std::move(of));
  return out;
}

struct PointChoice {
  std::size_t link = 0;
  PointFit fit;
};

template <typename FitOf>
PointChoice choose_link(const PointSightings& point, std::size_t innermost, FitOf fit_of) {
  PointChoice out;
  for (std::size_t l = point.on_link.size(); l-- > innermost;) {
    const PointFit fit = fit_of(point.on_link[l]);
    if (fit.rms_m < kClearlyBetter * out.fit.rms_m) out = {l, fit};
  }
  return out;
}

// A point that rests, or all but does, fits any base: what one leaves open the others tell.
std::vector<PointChoice> choose_links(const std::vector<PointSightings>& points) {
  std::vector<PointChoice> best;
  double least = std::numeric_limits<double>::infinity();
  for (const PointSightings& from : points) {
    for (std::size_t l = from.on_link.size(); l-- > 1;) {
      const Pose T_camera_base = fit_point(from.on_link[l]).T_camera_base;
      std::vector<PointChoice> choices;
      double sum = 0.0;
      for (const PointSightings& point : points) {
        choices.push_back(choose_link(point, points.size() > 1 ? 0 : 1, [&](const auto& pairs) {
          return point_beside(T_camera_base, pairs);
        }));
        sum += choices.back().fit.rms_m;
      }
      if (sum >= kClearlyBetter * least) continue;
      least = sum;
      best = std::move(choices);
    }
  }
  return best;
}

bool carries_links(const KinematicTree& tree, LinkId link) {
  return std::ranges::any_of(
      tree.joints, [&](const Joint& joint) { return joint.parent == link && is_movable(joint); });
}

// A point on an inner joint's axis rests whatever the joints do: sockets alone would always choose
// it.
PointChoice choose_last_link(const KinematicTree& nominal, const PointSightings& point) {
  PointChoice out;
  for (std::size_t l = point.on_link.size(); l-- > 1;) {
    if (carries_links(nominal, LinkId{static_cast<int>(l)})) continue;
    PointFit fit;
    std::tie(fit.point, fit.rms_m) = point_in_targets(point.on_link[l]);
    if (fit.rms_m < kClearlyBetter * out.fit.rms_m) out = {l, fit};
  }
  return out;
}

}  // namespace

Placement place_points(const KinematicTree& nominal, const Eigen::MatrixXd& joint_values,
                       const PointObservations& points) {
  const std::vector<PointSightings> seen = sightings_of(nominal, joint_values, points);
  const bool measured = std::ranges::any_of(
      points.observations, [](const auto& point) { return point.position_m.has_value(); });
  std::vector<PointChoice> choices;
  if (measured) {
    choices = choose_links(seen);
  } else {
    for (const PointSightings& point : seen) choices.push_back(choose_last_link(nominal, point));
  }
  Placement out;
  if (!choices.empty()) out.T_camera_base = choices.front().fit.T_camera_base;
  for (std::size_t p = 0; p < choices.size(); ++p) {
    if (!std::isfinite(choices[p].fit.rms_m)) continue;
    Marker marker{seen[p].id, LinkId{static_cast<int>(choices[p].link)}, {}, 0.0};
    marker.T_link_marker.translation = choices[p].fit.point;
    out.markers.push_back(marker);
  }
  if (out.markers.empty()) {
    throw undetermined("placing the nominal robot", "fewer than four postures with a point",
                       "record more postures");
  }
  return out;
}

}  // namespace kinescope
