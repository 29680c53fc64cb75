// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/place_recording.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/bundle/hand_eye.h"
#include "calib/bundle/place_markers.h"
#include "kinematics/core/error.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope {
namespace {

using bundle::fit_mount;
using bundle::MountFit;
using bundle::PosePair;

// As in place_markers.cpp: a marker stays on its link unless another one's misfit is below this
// share of its own.
constexpr double kClearlyOther = 0.8;
// Of a marker, that its orientation weighs as much as by its corners.
constexpr double kHalfSide = 0.05;  // m
// Misfits below this are none, m and rad together.
constexpr double kLeastMisfit = 1e-5;

// A marker's sightings with where the robot has each of its links.
struct OnLinks {
  TagId id;
  const Marker* known = nullptr;  // of the robot
  std::vector<std::vector<PosePair>> pairs;
};

OnLinks on_links(const KinematicTree& robot, const Eigen::MatrixXd& joint_values,
                 const PoseTrack& track) {
  OnLinks out{track.id, robot.marker(track.id), {}};
  out.pairs.resize(robot.links.size());
  for (const PoseSample& sample : track.samples) {
    const Eigen::VectorXd q = joint_values.row(sample.frame);
    if (!q.allFinite()) continue;
    const std::vector<Pose> links = forward_kinematics(robot, q);
    for (std::size_t l = 0; l < links.size(); ++l)
      out.pairs[l].push_back({sample.T_camera_marker, links[l]});
  }
  return out;
}

// Corners of markers where they are seen, and where the robot has them in the base's frame.
struct CornerPairs {
  Eigen::Vector3d seen_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d base_mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d product = Eigen::Matrix3d::Zero();  // of seen with base, not yet centred
  double count = 0.0;

  void add(const OnLinks& marker) {
    for (const PosePair& pair : marker.pairs[marker.known->link.index()]) {
      const Pose T_base_marker = pair.T_base_link * marker.known->T_link_marker;
      for (const double x : {-kHalfSide, kHalfSide}) {
        for (const double y : {-kHalfSide, kHalfSide}) {
          const Eigen::Vector3d corner(x, y, 0.0);
          const Eigen::Vector3d seen = pair.T_camera_marker * corner;
          const Eigen::Vector3d base = T_base_marker * corner;
          seen_mean += seen;
          base_mean += base;
          product += seen * base.transpose();
          count += 1.0;
        }
      }
    }
  }

  [[nodiscard]] Pose T_camera_base() const {
    const Eigen::Vector3d seen = seen_mean / count;
    const Eigen::Vector3d base = base_mean / count;
    const Eigen::Matrix3d R = nearest_rotation(product / count - seen * base.transpose());
    return {Eigen::Quaterniond(R).normalized(), seen - R * base};
  }
};

// m and rad together, rms: of how far the marker is from where it sat.
double misfit_of(const OnLinks& marker, const Pose& T_camera_base) {
  double sum = 0.0;
  const std::vector<PosePair>& pairs = marker.pairs[marker.known->link.index()];
  for (const PosePair& pair : pairs) {
    const Pose off = (T_camera_base * pair.T_base_link * marker.known->T_link_marker).inverse() *
                     pair.T_camera_marker;
    sum += log_rotation(off.rotation).squaredNorm() + off.translation.squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

// -2 ln of the likelihood of a marker's sightings about a base, but for a constant: where it sat,
// or, for the price of six parameters (Schwarz 1978), elsewhere on its link.
double deviance_about(const OnLinks& marker, const Pose& T_camera_base) {
  constexpr double kParameters = 6.0;
  const std::vector<PosePair>& pairs = marker.pairs[marker.known->link.index()];
  const auto n = static_cast<double>(pairs.size());
  const auto of = [n](double misfit) { return 2.0 * n * std::log(std::max(kLeastMisfit, misfit)); };
  return std::min(of(misfit_of(marker, T_camera_base)),
                  of(fit_mount(pairs, T_camera_base).misfit) + kParameters * std::log(n));
}

// Each known marker alone, all of them, and what needs none.
std::vector<Pose> proposed_bases(const KinematicTree& robot, const Eigen::MatrixXd& joint_values,
                                 const PoseTracks& tracks, const std::vector<OnLinks>& known) {
  std::vector<Pose> out;
  CornerPairs all;
  for (const OnLinks& marker : known) {
    CornerPairs own;
    own.add(marker);
    all.add(marker);
    out.push_back(own.T_camera_base());
  }
  if (!known.empty()) out.push_back(all.T_camera_base());
  try {
    out.push_back(place_markers(robot, joint_values, tracks).T_camera_base);
  } catch (const Error& error) {
    // Too little motion for the one, markers that stayed for the others.
    if (error.code() != ExitCode::kUndetermined || out.empty()) throw;
  }
  return out;
}

Pose agreed_base(const std::vector<Pose>& proposed, const std::vector<OnLinks>& known) {
  Pose best = proposed.back();
  double least = std::numeric_limits<double>::infinity();
  for (const Pose& base : proposed) {
    double deviance = 0.0;
    for (const OnLinks& marker : known) deviance += deviance_about(marker, base);
    if (deviance >= least) continue;
    least = deviance;
    best = base;
  }
  return best;
}

struct OnLink {
  std::size_t link = 0;
  MountFit fit;
};

// The outermost link is tried first, as in place_markers.cpp.
OnLink best_link(const OnLinks& marker, const Pose& T_camera_base) {
  OnLink out;
  out.fit.misfit = std::numeric_limits<double>::infinity();
  for (std::size_t l = marker.pairs.size(); l-- > 0;) {
    const MountFit fit = fit_mount(marker.pairs[l], T_camera_base);
    if (fit.misfit < kClearlyOther * out.fit.misfit) out = {l, fit};
  }
  return out;
}

RecordedMarker recorded(const OnLinks& marker, const Pose& T_camera_base) {
  OnLink on = best_link(marker, T_camera_base);
  RecordedMarker out{{marker.id, {}, {}, 0.0}, marker.known != nullptr, false};
  if (marker.known != nullptr) {
    const std::size_t own = marker.known->link.index();
    const MountFit there = fit_mount(marker.pairs[own], T_camera_base);
    out.is_on_its_link = !(on.fit.misfit < kClearlyOther * there.misfit);
    if (out.is_on_its_link) on = {own, there};
    out.marker.size_m = marker.known->size_m;
  }
  out.marker.link = LinkId{static_cast<int>(on.link)};
  out.marker.T_link_marker = on.fit.T_link_marker;
  return out;
}

}  // namespace

RecordingPlacement place_recording(const KinematicTree& robot, const Eigen::MatrixXd& joint_values,
                                   const PoseTracks& tracks) {
  std::vector<OnLinks> markers;
  std::vector<OnLinks> known;
  for (const PoseTrack& track : tracks.tracks) {
    OnLinks marker = on_links(robot, joint_values, track);
    if (marker.pairs.empty() || marker.pairs.front().empty()) continue;
    if (marker.known != nullptr) known.push_back(marker);
    markers.push_back(std::move(marker));
  }
  RecordingPlacement out;
  out.T_camera_base = agreed_base(proposed_bases(robot, joint_values, tracks, known), known);
  for (const OnLinks& marker : markers) out.markers.push_back(recorded(marker, out.T_camera_base));
  return out;
}

std::optional<Marker> placed_marker(const KinematicTree& robot, const Eigen::MatrixXd& joint_values,
                                    const PoseTrack& track, const Pose& T_camera_base) {
  const OnLinks marker = on_links(robot, joint_values, track);
  if (marker.pairs.empty() || marker.pairs.front().empty()) return std::nullopt;
  const OnLink on = best_link(marker, T_camera_base);
  return Marker{track.id, LinkId{static_cast<int>(on.link)}, on.fit.T_link_marker, 0.0};
}

}  // namespace kinescope
