// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/closed_form.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "calib/bundle/hand_eye.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope::hand_eye {
namespace {

constexpr std::size_t kFewestPairs = 3;
// Of the frames are in the second solution. A quarter of a small marker's planar poses may flip.
constexpr double kTrusted = 0.7;

double open_by(const Pose& X, const Pose& Y, const MotionPair& pair) {
  const Pose T = (X * pair.T_camera_target).inverse() * (pair.B * Y);
  return std::hypot(T.translation.norm(),
                    angle_between(T.rotation, Eigen::Quaterniond::Identity()));
}

Pose mean_of(const std::vector<Pose>& poses) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  for (const Pose& pose : poses) {
    rotation += pose.matrix3();
    translation += pose.translation / static_cast<double>(poses.size());
  }
  return {Eigen::Quaterniond(nearest_rotation(rotation)).normalized(), translation};
}

Pose target_of(const std::vector<MotionPair>& pairs, const Pose& X) {
  std::vector<Pose> out;
  for (const MotionPair& pair : pairs) out.push_back(pair.B.inverse() * X * pair.T_camera_target);
  return mean_of(out);
}

// Translations of both for known rotations, from R_X t_T + t_X = R_B t_Y + t_B; of several
// solutions the shortest.
Pose with_translation(const std::vector<MotionPair>& pairs, const Eigen::Matrix3d& R_X) {
  const auto rows = 3 * static_cast<Eigen::Index>(pairs.size());
  Eigen::MatrixXd A(rows, 6);
  Eigen::VectorXd b(rows);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto row = 3 * static_cast<Eigen::Index>(i);
    A.block<3, 3>(row, 0).setIdentity();
    A.block<3, 3>(row, 3) = -pairs[i].B.matrix3();
    b.segment<3>(row) = pairs[i].B.translation - R_X * pairs[i].T_camera_target.translation;
  }
  return {Eigen::Quaterniond(R_X).normalized(), shortest_least_squares(A, b).head<3>()};
}

// Park and Martin 1994, eq. 20, with Kabsch's rotation in place of (M'M)^-1/2 M', which needs three
// axes: rotation vectors of pairs are turned by R_X.
Pose park(const std::vector<MotionPair>& pairs) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      const auto a = log_rotation(pairs[i].B.rotation * pairs[j].B.rotation.conjugate());
      const auto c = log_rotation(pairs[i].T_camera_target.rotation *
                                  pairs[j].T_camera_target.rotation.conjugate());
      sum += a * c.transpose();
    }
  }
  return with_translation(pairs, nearest_rotation(sum));
}

// Shah 2013, section 3: vec(R_X) = (R_T kron R_B) vec(R_Y), both in the first singular vectors of
// the sum over frames.
Pose shah(const std::vector<MotionPair>& pairs) {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(9, 9);
  for (const MotionPair& pair : pairs) {
    const Eigen::Matrix3d T = pair.T_camera_target.matrix3();
    const Eigen::Matrix3d B = pair.B.matrix3();
    for (Eigen::Index i = 0; i < 3; ++i)
      for (Eigen::Index j = 0; j < 3; ++j) K.block<3, 3>(3 * i, 3 * j) += T(i, j) * B;
  }
  const Eigen::VectorXd first = singular_value_decomposition(K).U.col(0);
  Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix3d>(first.data());
  if (R.determinant() < 0.0) R = -R;
  return with_translation(pairs, nearest_rotation(R));
}

Pose from_everywhere(const std::vector<MotionPair>& pairs) {
  std::vector<bundle::PosePair> both;
  for (const MotionPair& pair : pairs) both.push_back({pair.T_camera_target, pair.B});
  return bundle::best_base(bundle::hand_eye_cost(both)).inverse();
}

struct Solver {
  const char* name;
  Pose (*solve)(const std::vector<MotionPair>&);
};
constexpr std::array<Solver, 3> kSolvers{{{"Park and Martin 1994", park},
                                          {"Shah 2013", shah},
                                          {"Dornaika and Horaud 1998", from_everywhere}}};
constexpr std::size_t kLinearSolvers = 2;  // the first ones

// Thousands of frames of a film say no more than some, spread evenly.
std::vector<MotionPair> thinned(const std::vector<MotionPair>& pairs) {
  constexpr std::size_t kMost = 150;  // 11 000 pairs
  if (pairs.size() <= kMost) return pairs;
  std::vector<MotionPair> out;
  for (std::size_t k = 0; k < kMost; ++k) out.push_back(pairs[k * pairs.size() / kMost]);
  return out;
}

// Of the two planar poses the one that closes better.
void choose_branches(std::vector<MotionPair>& pairs, const Pose& X, const Pose& Y) {
  for (MotionPair& pair : pairs) {
    if (!pair.alternative) continue;
    MotionPair other = pair;
    std::swap(other.T_camera_target, *other.alternative);
    if (open_by(X, Y, other) < open_by(X, Y, pair)) pair = other;
  }
}

std::vector<MotionPair> best_of(const std::vector<MotionPair>& pairs, const Pose& X,
                                const Pose& Y) {
  std::vector<double> open;
  for (const MotionPair& pair : pairs) open.push_back(open_by(X, Y, pair));
  std::vector<std::size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return open[k]; });
  const auto count = static_cast<std::size_t>(kTrusted * static_cast<double>(pairs.size()));
  order.resize(std::max(count, std::min(kFewestPairs, pairs.size())));
  std::ranges::sort(order);
  std::vector<MotionPair> out;
  for (const std::size_t k : order) out.push_back(pairs[k]);
  return out;
}

double misfit_of(const std::vector<MotionPair>& pairs, const Pose& X, const Pose& Y) {
  std::vector<double> open;
  for (const MotionPair& pair : pairs) open.push_back(open_by(X, Y, pair));
  return median_of(std::move(open));
}

}  // namespace

HandEyeStart target_for(std::vector<MotionPair> pairs, const Pose& X) {
  Pose Y = target_of(pairs, X);
  choose_branches(pairs, X, Y);
  Y = target_of(best_of(pairs, X, Y), X);
  choose_branches(pairs, X, Y);
  Y = target_of(best_of(pairs, X, Y), X);
  return {X, Y, misfit_of(pairs, X, Y), ""};
}

namespace {

std::optional<HandEyeStart> best_start(std::vector<MotionPair> pairs,
                                       std::span<const Solver> solvers) {
  constexpr int kRounds = 3;
  if (pairs.size() < kFewestPairs) return std::nullopt;
  pairs = thinned(pairs);
  std::optional<HandEyeStart> best;
  const auto keep = [&](const HandEyeStart& start) {
    if (std::isfinite(start.misfit) && (!best || start.misfit < best->misfit)) best = start;
  };
  for (const Solver& solver : solvers) {
    std::vector<MotionPair> in = pairs;
    for (int round = 0; round < kRounds; ++round) {
      HandEyeStart start = target_for(pairs, solver.solve(in));
      start.solver = solver.name;
      keep(start);
      std::vector<MotionPair> chosen = pairs;
      choose_branches(chosen, start.X, start.Y);
      in = best_of(chosen, start.X, start.Y);
    }
  }
  return best;
}

}  // namespace

std::optional<HandEyeStart> closed_form(std::vector<MotionPair> pairs) {
  return best_start(std::move(pairs), kSolvers);
}

std::optional<HandEyeStart> linear_closed_form(std::vector<MotionPair> pairs) {
  return best_start(std::move(pairs), std::span(kSolvers).first(kLinearSolvers));
}

}  // namespace kinescope::hand_eye
