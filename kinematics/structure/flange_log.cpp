// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/flange_log.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include <Eigen/SVD>

#include "kinematics/core/median.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope {
namespace {

constexpr int kPositionColumns = 3;
constexpr std::size_t kFrames = 24;  // 276 pairs
// Of the squared rotations between frames. Poses of a marker 40 px wide, known to 1 deg, that turns
// by 20 deg leave 0.3 %; six joints of a robot, read as a pose, left 40 % and more.
constexpr double kExplained = 0.95;
constexpr double kAtRest = 0.1;      // of the flange's rotations
constexpr double kSecondAxis = 0.1;  // of the first: about one axis alone a joint turns, too
constexpr double kTrusted = 0.8;     // of the pairs: a marker's planar poses may flip

using Poses = std::vector<std::optional<Pose>>;  // one a chosen frame

Eigen::Quaterniond about(const Eigen::Vector3d& axis, double angle) {
  return exp_rotation(angle * axis);
}

Eigen::Quaterniond fixed_xyz(double x, double y, double z) {
  return about(Eigen::Vector3d::UnitZ(), z) * about(Eigen::Vector3d::UnitY(), y) *
         about(Eigen::Vector3d::UnitX(), x);
}

// How three or four columns are read as a rotation.
struct Convention {
  const char* words;
  int columns;
  bool angles;  ///< in rad or deg
  Eigen::Quaterniond (*read)(const Eigen::VectorXd& row);
};

constexpr std::array<Convention, 5> kConventions{{
    {"quaternion, w last", 4, false,
     [](const Eigen::VectorXd& q) { return Eigen::Quaterniond(q[3], q[0], q[1], q[2]); }},
    {"quaternion, w first", 4, false,
     [](const Eigen::VectorXd& q) { return Eigen::Quaterniond(q[0], q[1], q[2], q[3]); }},
    {"rotation vector", 3, true,
     [](const Eigen::VectorXd& v) { return exp_rotation(Eigen::Vector3d(v.head<3>())); }},
    {"roll, pitch, yaw about fixed axes", 3, true,
     [](const Eigen::VectorXd& v) { return fixed_xyz(v[0], v[1], v[2]); }},
    {"angles about z, then y, then x", 3, true,
     [](const Eigen::VectorXd& v) { return fixed_xyz(v[2], v[1], v[0]); }},
}};

bool has_unit_norm(const Eigen::MatrixXd& rows) {
  constexpr double kDigits = 1e-2;  // logs with two digits
  return ((rows.rowwise().norm().array() - 1.0).abs() < kDigits).all();
}

std::vector<int> range_of(int first, int count) {
  std::vector<int> out(static_cast<std::size_t>(count));
  std::iota(out.begin(), out.end(), first);
  return out;
}

// All ways to read the log as position and rotation that stand beside each other.
struct Reading {
  FlangeColumns columns;
  const Convention* convention = nullptr;
  double factor = 1.0;  ///< of angles, to rad
};

std::vector<Reading> readings_of(const JointLog& log) {
  std::vector<Reading> out;
  const auto channels = static_cast<int>(log.channels.size());
  for (const Convention& convention : kConventions) {
    const int pose = kPositionColumns + convention.columns;
    if (channels < pose || channels > pose + 1) continue;
    for (int first = 0; first + pose <= channels; ++first) {
      for (const bool position_first : {true, false}) {
        const int rotation = position_first ? first + kPositionColumns : first;
        const Eigen::MatrixXd rows = log.values.middleCols(rotation, convention.columns);
        if (!convention.angles && !has_unit_norm(rows)) continue;
        const bool degrees =
            convention.angles && rows.cwiseAbs().maxCoeff() > 2.0 * std::numbers::pi;
        Reading reading;
        reading.columns.position =
            range_of(position_first ? first : first + convention.columns, kPositionColumns);
        reading.columns.rotation = range_of(rotation, convention.columns);
        reading.columns.convention = convention.words;
        reading.convention = &convention;
        reading.factor = degrees ? std::numbers::pi / 180.0 : 1.0;
        out.push_back(std::move(reading));
      }
    }
  }
  return out;
}

Poses poses_of(const Reading& reading, const Eigen::MatrixXd& values, bool inverted) {
  Poses out;
  const FlangeColumns& columns = reading.columns;
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    const Eigen::VectorXd rotation =
        values.row(i).segment(columns.rotation.front(), reading.convention->columns);
    const Eigen::Vector3d position = values.row(i).segment<3>(columns.position.front());
    if (!rotation.allFinite() || !position.allFinite()) {
      out.emplace_back();
      continue;
    }
    const Pose pose{reading.convention->read(reading.factor * rotation).normalized(), position};
    out.emplace_back(inverted ? pose.inverse() : pose);
  }
  return out;
}

// Rotation vectors between all pairs of frames, each in the frame of the first.
struct Pairs {
  Eigen::Matrix3Xd marker;
  Eigen::Matrix3Xd flange;
};

Pairs pairs_of(const Poses& marker, const Poses& flange) {
  const auto most = static_cast<Eigen::Index>(marker.size() * marker.size() / 2);
  Pairs out{Eigen::Matrix3Xd(3, most), Eigen::Matrix3Xd(3, most)};
  Eigen::Index n = 0;
  const auto turn = [](const Pose& from, const Pose& to) {
    return log_rotation(from.rotation.conjugate() * to.rotation);
  };
  for (std::size_t i = 0; i < marker.size(); ++i) {
    for (std::size_t j = i + 1; j < marker.size(); ++j) {
      if (!marker[i] || !marker[j] || !flange[i] || !flange[j]) continue;
      out.marker.col(n) = turn(*marker[i], *marker[j]);
      out.flange.col(n++) = turn(*flange[i], *flange[j]);
    }
  }
  out.marker.conservativeResize(Eigen::NoChange, n);
  out.flange.conservativeResize(Eigen::NoChange, n);
  return out;
}

// Kabsch 1976: R of the least |marker - R flange|.
Eigen::Matrix3d best_rotation(const Pairs& pairs) {
  return nearest_rotation(pairs.marker * pairs.flange.transpose());
}

bool turns_about_two_axes(const Eigen::Matrix3Xd& turns) {
  const Eigen::Matrix3d scatter = turns * turns.transpose();
  const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3d>(scatter).singularValues();
  return values[1] > kSecondAxis * kSecondAxis * values[0];
}

struct Closure {
  double explained = 0.0;  ///< of rotations and positions, the lesser share of the squares
  double misfit_rad = 0.0;
  double flange_rad = 0.0;  ///< rms of its rotations
};

// Of the positions, in whatever unit, by Z and the position of X:
//   t_A = scale R_Z t_B + R_A R_X' t_X + t_Z.
double explained_positions(const Poses& marker, const Poses& flange, const Eigen::Matrix3d& R_X) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  std::vector<std::size_t> both;
  for (std::size_t i = 0; i < marker.size(); ++i) {
    if (!marker[i] || !flange[i]) continue;
    both.push_back(i);
    sum += marker[i]->matrix3() * R_X.transpose() * flange[i]->matrix3().transpose();
  }
  const Eigen::Matrix3d R_Z = nearest_rotation(sum);
  constexpr int kUnknowns = 7;
  const auto rows = 3 * std::ssize(both);
  Eigen::MatrixXd A(rows, kUnknowns);
  Eigen::VectorXd b(rows);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < both.size(); ++k) {
    const Pose& T_A = *marker[both[k]];
    const auto row = 3 * static_cast<Eigen::Index>(k);
    A.block<3, 1>(row, 0) = R_Z * flange[both[k]]->translation;
    A.block<3, 3>(row, 1) = T_A.matrix3() * R_X.transpose();
    A.block<3, 3>(row, 4).setIdentity();
    b.segment<3>(row) = T_A.translation;
    mean += T_A.translation / static_cast<double>(both.size());
  }
  const double left = (b - A * A.colPivHouseholderQr().solve(b)).squaredNorm();
  const double size = (b - mean.replicate(std::ssize(both), 1)).squaredNorm();
  return size > 0.0 ? 1.0 - left / size : 0.0;
}

// Rotations: of the pairs that fit best, after one fit to all.
Closure closure_of(const Pairs& all, const Poses& marker, const Poses& flange) {
  constexpr Eigen::Index kFewestPairs = 20;
  if (all.flange.cols() < kFewestPairs || !turns_about_two_axes(all.flange)) return {};
  const Eigen::RowVectorXd misfit =
      (all.marker - best_rotation(all) * all.flange).colwise().squaredNorm();
  std::vector<Eigen::Index> order(static_cast<std::size_t>(misfit.size()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](Eigen::Index k) { return misfit[k]; });
  order.resize(static_cast<std::size_t>(kTrusted * static_cast<double>(order.size())));
  const Pairs trusted{all.marker(Eigen::all, order), all.flange(Eigen::all, order)};
  const Eigen::Matrix3d R_marker_flange = best_rotation(trusted);
  const auto n = static_cast<double>(trusted.flange.cols());
  const double left = (trusted.marker - R_marker_flange * trusted.flange).squaredNorm();
  const double size = trusted.marker.squaredNorm();
  Closure out{size > 0.0 ? 1.0 - left / size : 0.0, std::sqrt(left / n),
              std::sqrt(trusted.flange.squaredNorm() / n)};
  if (out.explained > kExplained) {
    out.explained =
        std::min(out.explained, explained_positions(marker, flange, R_marker_flange.transpose()));
  }
  return out;
}

bool is_at_rest(const Pairs& pairs, double flange_rad) {
  std::vector<double> sizes;
  for (Eigen::Index k = 0; k < pairs.marker.cols(); ++k)
    sizes.push_back(pairs.marker.col(k).norm());
  return sizes.empty() || median_of(std::move(sizes)) < kAtRest * flange_rad;
}

class FlangeSearch {
 public:
  FlangeSearch(const PoseTracks& tracks, const JointLog& log) : log_(log) {
    const std::size_t frames = tracks.times_s.size();
    const std::size_t every = std::max<std::size_t>(1, frames / kFrames);
    std::vector<std::optional<std::size_t>> chosen(frames);
    for (std::size_t f = 0; f < frames; f += every) {
      chosen[f] = times_s_.size();
      times_s_.push_back(tracks.times_s[f]);
    }
    for (const PoseTrack& track : tracks.tracks) {
      Poses poses(times_s_.size());
      for (const PoseSample& sample : track.samples) {
        const auto at = chosen[static_cast<std::size_t>(sample.frame)];
        if (at) poses[*at] = sample.T_camera_marker;
      }
      markers_.emplace_back(track.id, std::move(poses));
    }
  }

  // The best reading that explains every marker that turns.
  [[nodiscard]] std::optional<FlangeColumns> found(double offset_s) const {
    std::optional<FlangeColumns> best;
    double most = kExplained;
    for (const Reading& reading : readings_of(log_)) {
      for (const double offset : offsets(offset_s)) {
        const Eigen::MatrixXd values = resample(log_, times_s_, offset);
        for (const bool inverted : {false, true}) {
          const auto [marker, closure] = least_explained(poses_of(reading, values, inverted));
          if (!marker || closure.explained <= most) continue;
          most = closure.explained;
          best = reading.columns;
          best->inverted = inverted;
          best->marker = *marker;
          best->misfit_rad = closure.misfit_rad;
        }
      }
    }
    return best;
  }

 private:
  static std::vector<double> offsets(double most_s) {
    constexpr double kStep = 0.05;  // s: half of it is a fortieth of a radian at 1 rad/s
    const int steps = static_cast<int>(std::floor(most_s / kStep));
    std::vector<double> out{0.0};
    for (int k = 1; k <= steps; ++k) {
      out.push_back(k * kStep);
      out.push_back(-k * kStep);
    }
    return out;
  }

  [[nodiscard]] std::pair<std::optional<TagId>, Closure> least_explained(
      const Poses& flange) const {
    std::optional<TagId> marker;
    Closure least;
    for (const auto& [id, poses] : markers_) {
      const Pairs pairs = pairs_of(poses, flange);
      const Closure closure = closure_of(pairs, poses, flange);
      if (is_at_rest(pairs, closure.flange_rad)) continue;
      if (marker && closure.explained >= least.explained) continue;
      marker = id;
      least = closure;
      if (least.explained < kExplained) break;
    }
    return {marker, least};
  }

  const JointLog& log_;
  std::vector<double> times_s_;  // of the chosen frames
  std::vector<std::pair<TagId, Poses>> markers_;
};

}  // namespace

std::optional<FlangeColumns> flange_columns(const PoseTracks& tracks, const JointLog& log,
                                            double offset_s) {
  if (log.empty() || tracks.times_s.empty()) return std::nullopt;
  return FlangeSearch(tracks, log).found(offset_s);
}

}  // namespace kinescope
