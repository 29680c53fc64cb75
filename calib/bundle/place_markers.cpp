// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/place_markers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/LU>
#include <fmt/format.h>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// A measured pose and where the nominal robot has the link at that instant.
struct PosePair {
  Pose T_camera_marker;
  Pose T_base_link;
};

struct HandEye {
  Pose T_camera_base;
  Pose T_link_marker;
  double rms_m = std::numeric_limits<double>::infinity();
  double rms_rad = std::numeric_limits<double>::infinity();
};

std::optional<std::vector<Pose>> links_at(const KinematicTree& tree,
                                          const Eigen::MatrixXd& joint_values, int frame) {
  const Eigen::VectorXd q = joint_values.row(frame);
  if (!q.allFinite()) return std::nullopt;
  return forward_kinematics(tree, q);
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const SingularValues svd = singular_value_decomposition(m);
  const Eigen::Matrix3d V = svd.V;
  Eigen::Matrix3d U = svd.U;
  if ((U * V.transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  return U * V.transpose();
}

// T_camera_marker = T_camera_base T_base_link T_link_marker for all pairs. Shah 2013, section 3:
// the two rotations are the first singular vectors of sum R_link (x) R_camera_marker.
std::optional<HandEye> hand_eye(const std::vector<PosePair>& pairs) {
  if (pairs.size() < 3) return std::nullopt;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(9, 9);
  for (const PosePair& pair : pairs) {
    const Eigen::Matrix3d A = pair.T_base_link.matrix3();
    const Eigen::Matrix3d B = pair.T_camera_marker.matrix3();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) K.block<3, 3>(3 * i, 3 * j) += A(i, j) * B;
    }
  }
  const SingularValues svd = singular_value_decomposition(K);
  const auto as_matrix = [](const Eigen::VectorXd& v) {
    const Eigen::Matrix3d m = Eigen::Map<const Eigen::Matrix3d>(v.data());
    return nearest_rotation(m.determinant() < 0.0 ? Eigen::Matrix3d(-m) : m);
  };
  HandEye out;
  const Eigen::Matrix3d R_camera_base = as_matrix(svd.U.col(0));
  // V holds R_marker_link.
  const Eigen::Matrix3d R_link_marker = as_matrix(svd.V.col(0)).transpose();
  Matrix6d normal = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  for (const PosePair& pair : pairs) {
    Eigen::Matrix<double, 3, 6> A;
    A << Eigen::Matrix3d::Identity(), R_camera_base * pair.T_base_link.matrix3();
    normal += A.transpose() * A;
    right += A.transpose() *
             (pair.T_camera_marker.translation - R_camera_base * pair.T_base_link.translation);
  }
  normal.diagonal().array() += 1e-9 * normal.diagonal().maxCoeff();
  const Vector6d t = solve_symmetric(normal, right);
  out.T_camera_base = {Eigen::Quaterniond(R_camera_base).normalized(), t.head<3>()};
  out.T_link_marker = {Eigen::Quaterniond(R_link_marker).normalized(), t.tail<3>()};
  double sum_m = 0.0;
  double sum_rad = 0.0;
  for (const PosePair& pair : pairs) {
    const Pose predicted = out.T_camera_base * pair.T_base_link * out.T_link_marker;
    sum_m += (predicted.translation - pair.T_camera_marker.translation).squaredNorm();
    sum_rad += std::pow(angle_between(predicted.rotation, pair.T_camera_marker.rotation), 2);
  }
  out.rms_m = std::sqrt(sum_m / static_cast<double>(pairs.size()));
  out.rms_rad = std::sqrt(sum_rad / static_cast<double>(pairs.size()));
  return out;
}

std::vector<PosePair> pairs_for(const KinematicTree& nominal, const Eigen::MatrixXd& joint_values,
                                const PoseTrack& track, LinkId link) {
  std::vector<PosePair> pairs;
  for (const PoseSample& sample : track.samples) {
    if (const auto links = links_at(nominal, joint_values, sample.frame)) {
      pairs.push_back({sample.T_camera_marker, (*links)[link.index()]});
    }
  }
  return pairs;
}

// A marker on an inner link misses by the motion of the joints behind that link, which is large;
// errors of the nominal robot alone can make an inner link fit a little better. So the outermost
// link stays unless another one's misfit is below this share of its own.
constexpr double kClearlyBetter = 0.8;

// One length for a misfit in m and rad: at arm's length (1 m) a radian moves a point by a metre.
double misfit(const HandEye& fit) { return std::hypot(fit.rms_m, fit.rms_rad); }

// Distance that the joint values move a link's frame over the recording, m and rad together.
double excursion(const std::vector<PosePair>& pairs) {
  double most = 0.0;
  for (const PosePair& pair : pairs) {
    const Pose move = pairs.front().T_base_link.inverse() * pair.T_base_link;
    most = std::max(most, log_rotation(move.rotation).norm());
  }
  return most;
}

// The mean mount of a marker for a known base.
std::pair<Pose, double> mount_for(const std::vector<PosePair>& pairs, const Pose& T_camera_base) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  std::vector<Pose> mounts;
  for (const PosePair& pair : pairs) {
    mounts.push_back((T_camera_base * pair.T_base_link).inverse() * pair.T_camera_marker);
    rotation += mounts.back().matrix3();
    translation += mounts.back().translation / static_cast<double>(pairs.size());
  }
  const Pose mean{Eigen::Quaterniond(nearest_rotation(rotation)).normalized(), translation};
  double sum = 0.0;
  for (const Pose& mount : mounts) {
    sum += (mount.translation - translation).squaredNorm() +
           std::pow(angle_between(mount.rotation, mean.rotation), 2);
  }
  return {mean, std::sqrt(sum / static_cast<double>(mounts.size()))};
}

}  // namespace

Placement place_markers(const KinematicTree& nominal, const Eigen::MatrixXd& joint_values,
                        const PoseTracks& tracks) {
  // The marker and link that the robot turns most, and that fit, give the base.
  constexpr double kMinTurn = 0.2;  // rad; less motion does not place a base
  std::optional<HandEye> best;
  for (const PoseTrack& track : tracks.tracks) {
    for (std::size_t l = nominal.links.size(); l-- > 1;) {
      const auto pairs = pairs_for(nominal, joint_values, track, LinkId{static_cast<int>(l)});
      if (pairs.size() < 3 || excursion(pairs) < kMinTurn) continue;
      const auto fit = hand_eye(pairs);
      if (fit && (!best || misfit(*fit) < kClearlyBetter * misfit(*best))) best = fit;
    }
  }
  if (!best) {
    throw undetermined("placing the nominal robot",
                       "no marker is turned by the joints by more than 11 degrees",
                       "record postures in which at least two joints before a marker move");
  }
  Placement out{best->T_camera_base, {}};
  for (const PoseTrack& track : tracks.tracks) {
    Marker marker{track.id, LinkId{0}, {}, 0.0};
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t l = nominal.links.size(); l-- > 0;) {
      const auto pairs = pairs_for(nominal, joint_values, track, LinkId{static_cast<int>(l)});
      if (pairs.empty()) continue;
      const auto [mount, spread] = mount_for(pairs, out.T_camera_base);
      if (spread < kClearlyBetter * least) {
        least = spread;
        marker.link = LinkId{static_cast<int>(l)};
        marker.T_link_marker = mount;
      }
    }
    if (std::isfinite(least)) out.markers.push_back(marker);
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
