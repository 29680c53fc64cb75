// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/observability.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "calib/hand_eye/held_out.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::hand_eye {
namespace {

constexpr const char* kRemedy =
    "record 15 poses or more, the hand turned by 30 degrees and more about two axes or three";

std::string direction(const Eigen::Vector3d& v) {
  Eigen::Vector3d unit = v.normalized();
  Eigen::Index largest = 0;
  unit.cwiseAbs().maxCoeff(&largest);
  if (unit[largest] < 0.0) unit = -unit;
  constexpr double kShown = 0.005;  // smaller shows as zero, of either sign
  unit = (unit.array().abs() < kShown).select(0.0, unit);
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", unit.x(), unit.y(), unit.z());
}

// Mean outer product of the rotations between two frames, in the first one's flange.
SymmetricEigen turns_of(const Model& model, const Fit& fit) {
  constexpr std::size_t kMost = 100;
  std::vector<Eigen::Quaterniond> rotations;
  const std::size_t n = fit.used.size();
  for (std::size_t k = 0; k < std::min(n, kMost); ++k) {
    const Frame& frame = model.data().frames[fit.used[k * n / std::min(n, kMost)]];
    rotations.push_back(flange_at(model, fit.state, frame).T_base_flange.rotation);
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double pairs = 0.0;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    for (std::size_t j = i + 1; j < rotations.size(); ++j) {
      const Eigen::Vector3d turn = log_rotation(rotations[i].conjugate() * rotations[j]);
      scatter += turn * turn.transpose();
      pairs += 1.0;
    }
  }
  return symmetric_eigen(scatter / std::max(1.0, pairs));
}

double misfit_rad(const Model& model, const Fit& fit) {
  double sum = 0.0;
  for (const std::size_t f : fit.used)
    sum += std::pow(closed_loop(model.data().frames[f], value_of(fit.rows[f])).rad, 2);
  return std::sqrt(sum / static_cast<double>(fit.used.size()));
}

void require_turns(const Model& model, const Fit& fit) {
  // Below it noise alone would seem to show where the camera is along the first axis.
  constexpr double kAboveNoise = 3.0;
  constexpr double kLeastTurn = 1e-4;                   // rad: what logs round to
  constexpr double kEnoughTurn = 20.0 * kRadPerDegree;  // between poses that turn as kRemedy asks
  const SymmetricEigen turns = turns_of(model, fit);
  const double misfit = misfit_rad(model, fit);
  const double least = std::max(kLeastTurn, kAboveNoise * misfit);
  const auto about = [&](Eigen::Index k) { return std::sqrt(std::max(0.0, turns.values[k])); };
  if (about(2) < least && about(2) > kEnoughTurn) {
    throw undetermined(
        model.log().source,
        fmt::format("the hand turns by {:.2g} deg (rms between two poses), and its rotations miss "
                    "what the camera sees by {:.2g} deg",
                    about(2) / kRadPerDegree, misfit / kRadPerDegree),
        "check their convention, the order of the quaternion (w or x first) or of the angles, and "
        "that each row belongs to its image: t in both, or both in one order");
  }
  if (about(2) < least) {
    throw undetermined(
        model.log().source,
        fmt::format("the hand turns by {:.2g} deg (rms between two poses), not more than the "
                    "rotations' misfit shows: where the camera is on it is not determined",
                    about(2) / kRadPerDegree),
        kRemedy);
  }
  if (about(1) >= least) return;
  throw undetermined(
      model.log().source,
      fmt::format("the hand turns about one axis only, {} in the flange's frame, and by {:.2g} deg "
                  "about any other: the position of the camera along that axis is not determined",
                  direction(turns.vectors.col(2)), about(1) / kRadPerDegree),
      kRemedy);
}

// The worst direction of one pose block, its turns and shifts told apart.
struct Worst {
  double turn_rad = 0.0;
  double shift_m = 0.0;
  Eigen::Vector3d turn_axis;
  Eigen::Vector3d shift_axis;
};

Worst worst_of(const Eigen::MatrixXd& covariance, Eigen::Index at, const Eigen::Matrix3d& R) {
  const SymmetricEigen turn = symmetric_eigen(covariance.block<3, 3>(at, at));
  const SymmetricEigen shift = symmetric_eigen(covariance.block<3, 3>(at + 3, at + 3));
  return {std::sqrt(turn.values[2]), std::sqrt(shift.values[2]), R * turn.vectors.col(2),
          R * shift.vectors.col(2)};
}

}  // namespace

void require_enough_frames(const Data& data, const std::string& source) {
  // Five folds, and four poses or more left for each.
  constexpr std::size_t kFewest = 6;
  if (data.frames.size() >= kFewest) return;
  throw undetermined(source,
                     fmt::format("{} pose{} of the hand at which a marker was seen: too few to "
                                 "find two transforms and to judge them",
                                 data.frames.size(), data.frames.size() == 1 ? "" : "s"),
                     kRemedy);
}

void require_observable(const Model& model, const Fit& fit) {
  constexpr double kUseless = 0.1;  // rad or m, two standard deviations
  require_turns(model, fit);
  const auto covariance = covariance_of(fit.information);
  if (!covariance) {
    throw undetermined(model.log().source, "the poses leave a direction of the camera open",
                       kRemedy);
  }
  const bool on_hand = model.hypothesis().mount == CameraMount::kOnHand;
  const Eigen::Matrix3d R = bundle::from_block(fit.state.cameras.front().data()).matrix3();
  const Worst worst = worst_of(*covariance, 0, R);
  const char* frame = on_hand ? "flange" : "base";
  if (2.0 * worst.shift_m > kUseless) {
    throw undetermined(
        model.log().source,
        fmt::format("the position of the camera along {} in the {}'s frame is known to {:.0f} mm "
                    "only (two standard deviations)",
                    direction(worst.shift_axis), frame, 2e3 * worst.shift_m),
        kRemedy);
  }
  if (2.0 * worst.turn_rad > kUseless) {
    throw undetermined(
        model.log().source,
        fmt::format("the camera's rotation about {} in the {}'s frame is known to {:.0f} deg only "
                    "(two standard deviations)",
                    direction(worst.turn_axis), frame, 2.0 * worst.turn_rad / kRadPerDegree),
        kRemedy);
  }
}

}  // namespace kinescope::hand_eye
