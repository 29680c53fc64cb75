// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/rest.h"

#include <array>
#include <cmath>

#include "kinematics/core/median.h"
#include "kinematics/structure/attachment_cost.h"

namespace kinescope::structure_search {
namespace {

constexpr double kNoiseOnly = 4.0;  // variance over the declared one

// Component by component, so that views spoilt by an occlusion do not matter.
Pose median_pose(const Motion& motion) {
  const Pose reference = motion[motion.size() / 2].pose;
  std::array<std::vector<double>, 6> moves;
  const Pose inverse = reference.inverse();
  for (const MotionSample& sample : motion) {
    const Pose move = inverse * sample.pose;
    const Eigen::Vector3d turn = log_rotation(move.rotation);
    for (std::size_t i = 0; i < 3; ++i) {
      moves[i].push_back(turn[static_cast<Eigen::Index>(i)]);
      moves[i + 3].push_back(move.translation[static_cast<Eigen::Index>(i)]);
    }
  }
  Vector6d middle;
  for (std::size_t i = 0; i < 6; ++i) middle[static_cast<Eigen::Index>(i)] = median_of(moves[i]);
  return reference * Pose{exp_rotation(middle.head<3>()), middle.tail<3>()};
}

// Less than a robot moves by, at the distance of the body from the camera, `slack` times.
bool hardly_moves(const Motion& motion, const Pose& from, const Body& body, double slack) {
  constexpr double kTurn = 0.01;    // rad
  constexpr double kShift = 0.003;  // of the distance from the camera
  const Pose inverse = from.inverse();
  std::vector<double> turn;
  std::vector<double> shift;
  for (const MotionSample& sample : motion) {
    const Pose left = inverse * sample.pose;
    turn.push_back(log_rotation(left.rotation).norm());
    shift.push_back(left.translation.norm());
  }
  return median_of(std::move(turn)) <= slack * kTurn &&
         median_of(std::move(shift)) <= slack * kShift * distance_of({&body, 1});
}

// The body as if it were a link: where it was seen, as well as it was seen.
LinkPath seen_path(const Body& body) {
  LinkPath path = camera_path(static_cast<int>(body.at.size()));
  path.covariance.assign(path.pose.size(), Matrix6d::Zero());
  for (std::size_t i = 0; i < path.pose.size(); ++i) {
    const Sighting& s = body.at[i];
    path.valid[i] = s.seen ? 1 : 0;
    if (!s.seen) continue;
    path.pose[i] = s.pose;
    path.covariance[i] = s.covariance;
  }
  return path;
}

}  // namespace

bool may_rest(const Motion& motion, const Body& body) {
  constexpr double kSlack = 2.0;  // for the errors of few samples
  return hardly_moves(motion, median_pose(motion), body, kSlack);
}

std::optional<Attachment> practical_rest(const Body& body, int link, const LinkPath& path,
                                         const Readings& readings) {
  constexpr std::size_t kFewestSeen = 5;
  const RelativeMotion relative = relative_motion(body, path, readings);
  if (relative.motion.size() < kFewestSeen) return std::nullopt;
  ChainModel model;
  model.mount = median_pose(relative.motion);
  if (!hardly_moves(relative.motion, model.mount, body, 1.0)) return std::nullopt;
  return attachment_from(fit_chain(relative.motion, readings.value, model), link, relative, body,
                         readings);
}

bool rest_on_each_other(const Body& a, double motion_size, const Body& b,
                        const Readings& readings) {
  constexpr std::size_t kFewestRelative = 12;
  constexpr double kOfMotion = 0.1;  // what is left over how far they move
  const RelativeMotion relative = relative_motion(b, seen_path(a), readings);
  if (relative.motion.size() < kFewestRelative) return false;
  ChainModel model;
  model.mount = relative.motion[relative.motion.size() / 2].pose;
  const ChainFit fit = fit_chain(relative.motion, readings.value, model);
  const double left = std::hypot(fit.translation_rms, kLever * fit.rotation_rms);
  return fit.variance < kNoiseOnly || left < kOfMotion * motion_size;
}

bool keeps_pose(const Body& body, const LinkPath& path, const Readings& readings) {
  constexpr std::size_t kFewestTogether = 8;
  const RelativeMotion relative = relative_motion(body, path, readings);
  if (relative.motion.size() < kFewestTogether) return false;
  ChainModel model;
  model.mount = median_pose(relative.motion);
  return hardly_moves(relative.motion, model.mount, body, 1.0) ||
         fit_chain(relative.motion, readings.value, model).variance < kNoiseOnly;
}

bool keep_relative_pose(const Body& a, const Body& b, const Readings& readings) {
  return keeps_pose(b, seen_path(a), readings);
}

}  // namespace kinescope::structure_search
