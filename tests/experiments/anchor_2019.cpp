// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/anchor_2019.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Dense>

namespace kinescope {
namespace {

// Coefficients of the linear tests: 12 entries on [1, cos q, sin q]; 9 on [1] and 3 on [1, q].
constexpr double kTurnParameters = 36.0;
constexpr double kSlideParameters = 15.0;

struct Pair {
  int first = 0;
  int second = 0;
  Eigen::MatrixXd rotation;        // frames x 9, entries of R_ij
  Eigen::MatrixXd position;        // frames x 3, p_ij
  double rotation_variance = 0.0;  // of one entry
  double position_variance = 0.0;  // of one component
};

struct Edge {
  int first = 0;
  int second = 0;
  int channel = 0;
  JointType type = JointType::kRevolute;
  double cost = 0.0;
};

// Residual sum of squares of the columns of Y regressed on A.
double residual_sum(const Eigen::MatrixXd& Y, const Eigen::MatrixXd& A) {
  const Eigen::MatrixXd X = (A.transpose() * A).ldlt().solve(A.transpose() * Y);
  return (Y - A * X).squaredNorm();
}

// -2 ln likelihood with known noise, and BIC.
double cost_of(const Pair& pair, const Eigen::MatrixXd& rotation_basis,
               const Eigen::MatrixXd& position_basis, double parameters) {
  const double rotation = residual_sum(pair.rotation, rotation_basis) / pair.rotation_variance;
  const double position = residual_sum(pair.position, position_basis) / pair.position_variance;
  return rotation + position + parameters * std::log(static_cast<double>(pair.rotation.rows()));
}

std::vector<int> common_frames(const PoseTracks& tracks) {
  std::vector<int> seen(tracks.times_s.size(), 0);
  for (const PoseTrack& t : tracks.tracks) {
    for (const PoseSample& s : t.samples) ++seen[static_cast<std::size_t>(s.frame)];
  }
  std::vector<int> frames;
  for (std::size_t f = 0; f < seen.size(); ++f) {
    if (seen[f] == static_cast<int>(tracks.tracks.size())) frames.push_back(static_cast<int>(f));
  }
  return frames;
}

std::vector<std::vector<Pose>> poses_at(const PoseTracks& tracks, const std::vector<int>& frames) {
  std::vector<std::vector<Pose>> out;
  for (const PoseTrack& t : tracks.tracks) {
    std::vector<Pose> all(tracks.times_s.size());
    for (const PoseSample& s : t.samples)
      all[static_cast<std::size_t>(s.frame)] = s.T_camera_marker;
    std::vector<Pose>& chosen = out.emplace_back();
    for (const int f : frames) chosen.push_back(all[static_cast<std::size_t>(f)]);
  }
  return out;
}

Pair make_pair(int i, int j, const std::vector<std::vector<Pose>>& poses,
               const AnchorOptions& options) {
  const auto& a = poses[static_cast<std::size_t>(i)];
  const auto& b = poses[static_cast<std::size_t>(j)];
  const auto n = static_cast<Eigen::Index>(a.size());
  Pair pair{i, j, Eigen::MatrixXd(n, 9), Eigen::MatrixXd(n, 3)};
  double lever = 0.0;
  for (Eigen::Index f = 0; f < n; ++f) {
    const Pose relative = a[static_cast<std::size_t>(f)].inverse() * b[static_cast<std::size_t>(f)];
    const Eigen::Matrix3d R = relative.matrix3();
    pair.rotation.row(f) = Eigen::Map<const Eigen::Matrix<double, 1, 9>>(R.data());
    pair.position.row(f) = relative.translation.transpose();
    lever += relative.translation.squaredNorm() / static_cast<double>(n);
  }
  const double rotation = 2.0 * options.sigma_rad * options.sigma_rad;
  pair.rotation_variance = rotation * 6.0 / 9.0;
  pair.position_variance = 2.0 * options.sigma_m * options.sigma_m +
                           options.sigma_rad * options.sigma_rad * lever * 2.0 / 3.0;
  return pair;
}

void add_edges(const Pair& pair, const Eigen::MatrixXd& signals, std::vector<Edge>& edges) {
  const Eigen::Index n = signals.rows();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Ones(n, 1);
  for (Eigen::Index k = 0; k < signals.cols(); ++k) {
    Eigen::MatrixXd turn(n, 3);
    turn << one, signals.col(k).array().cos().matrix(), signals.col(k).array().sin().matrix();
    Eigen::MatrixXd line(n, 2);
    line << one, signals.col(k);
    const auto channel = static_cast<int>(k);
    edges.push_back({pair.first, pair.second, channel, JointType::kRevolute,
                     cost_of(pair, turn, turn, kTurnParameters)});
    edges.push_back({pair.first, pair.second, channel, JointType::kPrismatic,
                     cost_of(pair, one, line, kSlideParameters)});
  }
}

int root_of(std::vector<int>& parent, int i) {
  while (parent[static_cast<std::size_t>(i)] != i) i = parent[static_cast<std::size_t>(i)];
  return i;
}

}  // namespace

std::vector<AnchorEdge> find_edges_2019(const PoseTracks& tracks, const JointLog& log,
                                        const AnchorOptions& options) {
  const std::vector<int> frames = common_frames(tracks);
  std::vector<double> times;
  for (const int f : frames) times.push_back(tracks.times_s[static_cast<std::size_t>(f)]);
  const Eigen::MatrixXd signals = resample(log, times, 0.0, 1.0);
  const auto poses = poses_at(tracks, frames);
  const auto count = static_cast<int>(poses.size());
  std::vector<Edge> edges;
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) add_edges(make_pair(i, j, poses, options), signals, edges);
  }
  std::ranges::stable_sort(edges, {}, &Edge::cost);
  std::vector<int> parent(static_cast<std::size_t>(count));
  std::iota(parent.begin(), parent.end(), 0);
  std::vector<int> degree(static_cast<std::size_t>(count), 0);
  std::vector<char> used(static_cast<std::size_t>(signals.cols()), 0);
  std::vector<AnchorEdge> out;
  for (const Edge& e : edges) {
    const auto first = static_cast<std::size_t>(e.first);
    const auto second = static_cast<std::size_t>(e.second);
    if (used[static_cast<std::size_t>(e.channel)] != 0) continue;
    if (options.serial && (degree[first] >= 2 || degree[second] >= 2)) continue;
    const int a = root_of(parent, e.first);
    const int b = root_of(parent, e.second);
    if (a == b) continue;
    parent[static_cast<std::size_t>(a)] = b;
    ++degree[first];
    ++degree[second];
    used[static_cast<std::size_t>(e.channel)] = 1;
    out.push_back({tracks.tracks[first].id, tracks.tracks[second].id, e.type, e.channel});
  }
  return out;
}

}  // namespace kinescope
