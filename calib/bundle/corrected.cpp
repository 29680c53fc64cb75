// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/corrected.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace kinescope::bundle {
namespace {

const std::vector<int>& path_of(const Spec& spec, const Sighting& sighting) {
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  return spec.path[marker.link.index()];
}

// Of a joint that is on the way to the marker.
std::size_t place_on_path(const Spec& spec, const Sighting& sighting, int joint) {
  const std::vector<int>& path = path_of(spec, sighting);
  return static_cast<std::size_t>(std::ranges::find(path, joint) - path.begin());
}

double share_at(const Correction& correction, int frame) {
  return correction.share.size() == 0 ? 1.0 : correction.share[frame];
}

CameraModel changed(CameraModel camera, const std::array<double, kMaxIntrinsics>& by) {
  camera.fx += by[0];
  camera.fy += by[1];
  camera.cx += by[2];
  camera.cy += by[3];
  for (std::size_t i = 4; i < kMaxIntrinsics; ++i) camera.distortion[i - 4] += by[i];
  return camera;
}

const CameraModel& model_of(const Spec& spec, const Sighting& sighting) {
  return spec.cameras[static_cast<std::size_t>(sighting.camera)].model;
}

// The number of a marker's shape that a correction changes.
double& number_of(MarkerShape& shape, CorrectedPart part) {
  if (part == CorrectedPart::kMarkerSize) return shape.size;
  if (part == CorrectedPart::kMarkerShear) return shape.shear;
  return part == CorrectedPart::kMarkerWidth ? shape.width : shape.warp_m;
}

// What a corner moves by with that number: corners are linear in all of them.
Eigen::Vector3d d_corner(CorrectedPart part, const Eigen::Vector3d& corner_m) {
  MarkerShape unit{0.0, 0.0, 0.0, 0.0};
  number_of(unit, part) = 1.0;
  return unit.corner_m(corner_m);
}

// ad(a) b: the bracket of two twists.
Vector6d bracket(const Vector6d& a, const Vector6d& b) {
  Vector6d out;
  out.head<3>() = a.head<3>().cross(b.head<3>());
  out.tail<3>() = a.tail<3>().cross(b.head<3>()) + a.head<3>().cross(b.tail<3>());
  return out;
}

// exp(at + by) = exp(out) exp(at) to first order in `by`: the left Jacobian of SE(3), as a series
// (Barfoot 2017, section 7.1.5). Twists along one axis take its first term only.
Vector6d moved_before(const Vector6d& at, const Vector6d& by) {
  constexpr double kEnough = 1e-15;
  constexpr int kMostTerms = 30;
  Vector6d out = by;
  Vector6d term = by;
  for (int k = 2; k < kMostTerms; ++k) {
    term = bracket(at, term) / k;
    out += term;
    if (term.squaredNorm() <= kEnough * kEnough * by.squaredNorm()) break;
  }
  return out;
}

// exp(at + by) = exp(at) exp(out): the right one.
Vector6d moved_behind(const Vector6d& at, const Vector6d& by) { return moved_before(-at, by); }

Pose base_marker(const CorrectedError& at) {
  return at.T_camera_base.inverse() * at.chain.T_camera_marker;
}

// Of the residual by the growth of all that joints carry.
Eigen::VectorXd d_growth(const CorrectedError& at) {
  const Pose T_base_marker = base_marker(at);
  const Growth& growth = at.corrected.growth;
  const Eigen::Vector3d before_m =
      (T_base_marker.translation - growth.shift_m) / (1.0 + growth.relative);
  return at.error.d_marker.rightCols<3>() * (T_base_marker.matrix3().transpose() * before_m);
}

// Of the residual by a shift of the marker along the base's axes.
Eigen::VectorXd d_carried(const CorrectedError& at, const Eigen::Vector3d& shift_m) {
  return at.error.d_marker.rightCols<3>() * (base_marker(at).matrix3().transpose() * shift_m);
}

constexpr std::size_t kSquare = 4;

// Of the residual by a shift of the edges of a square towards its centre, 1/px: a corner is where
// two of them meet. `residual`: without that shift. The edges are where they are expected: those
// that were seen have the corners' own noise in them, which a shift towards the centre would seem
// to explain (by twice its variance over the length of an edge, in every sighting alike).
Eigen::VectorXd d_bloom(const Sighting& sighting, const Eigen::VectorXd& residual) {
  constexpr double kStraight = 1e-3;  // sine of an angle that is no corner's
  Eigen::VectorXd out = Eigen::VectorXd::Zero(residual.size());
  if (sighting.corners_px.size() != kSquare) return out;
  std::array<Eigen::Vector2d, kSquare> corners;
  for (std::size_t i = 0; i < kSquare; ++i) {
    corners[i] = sighting.corners_px[i] -
                 sighting.sigma * residual.segment<2>(static_cast<Eigen::Index>(2 * i));
  }
  for (std::size_t i = 0; i < kSquare; ++i) {
    const Eigen::Vector2d a = (corners[(i + 1) % kSquare] - corners[i]).normalized();
    const Eigen::Vector2d b = (corners[(i + kSquare - 1) % kSquare] - corners[i]).normalized();
    const double sine = std::abs(a.x() * b.y() - a.y() * b.x());
    if (!(sine > kStraight)) continue;
    out.segment<2>(static_cast<Eigen::Index>(2 * i)) = -(a + b) / (sine * sighting.sigma);
  }
  return out;
}

// Shifts the edges in the residual and turns its slopes with them.
void add_bloom(const Sighting& sighting, double bloom_px, SightingError& error) {
  if (bloom_px == 0.0 || sighting.corners_px.size() != kSquare) return;
  constexpr double kStep = 1e-3;  // in sigmas: edges are long and straight beside it
  const Eigen::VectorXd plain = error.residual;
  const Eigen::Index size = plain.size();
  error.residual += bloom_px * d_bloom(sighting, plain);
  Eigen::MatrixXd turned = Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index k = 0; k < size; ++k) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(size, k);
    turned.col(k) += bloom_px / (2.0 * kStep) *
                     (d_bloom(sighting, plain + step) - d_bloom(sighting, plain - step));
  }
  error.d_marker = turned * error.d_marker;
  if (error.d_intrinsics.rows() == size) error.d_intrinsics = turned * error.d_intrinsics;
}

bool acts_in(const Correction& correction, int frame) {
  if (correction.twists.rows() > 0) return !correction.twists.row(frame).isZero(0.0);
  return share_at(correction, frame) != 0.0;
}

// Rows of the image between a corner and the middle row.
double rows_from_middle(const Spec& spec, const Sighting& sighting, std::size_t corner) {
  return sighting.corners_px[corner].y() - 0.5 * model_of(spec, sighting).height;
}

}  // namespace

Vector6d twist_at(const Correction& correction, int frame) {
  if (correction.twists.rows() > 0) return correction.twists.row(frame).transpose();
  return share_at(correction, frame) * correction.direction;
}

std::vector<int> corrections_of(const Spec& spec, const Sighting& sighting) {
  const std::vector<int>& path = path_of(spec, sighting);
  std::vector<int> out;
  for (std::size_t c = 0; c < spec.corrections.size(); ++c) {
    const Correction& correction = spec.corrections[c];
    // There may be thousands that bear on a few frames each.
    if (correction.is_local && !acts_in(correction, sighting.frame)) continue;
    bool bears = true;
    switch (correction.part) {
      case CorrectedPart::kJoint:
        bears = std::ranges::find(path, correction.index) != path.end();
        break;
      case CorrectedPart::kMarker:
      case CorrectedPart::kMarkerWidth:
      case CorrectedPart::kMarkerShear:
      case CorrectedPart::kMarkerWarp:
        bears = correction.index == sighting.marker;
        break;
      case CorrectedPart::kMarkerSize:
        bears = correction.index == kEverywhere || correction.index == sighting.marker;
        break;
      case CorrectedPart::kIntrinsic:
      case CorrectedPart::kFocalLength:
      case CorrectedPart::kBloom:
      case CorrectedPart::kReadout:
        bears = sighting.kind == MeasurementKind::kCorners;
        break;
      case CorrectedPart::kClock:
        bears = correction.index == kEverywhere ||
                std::ranges::find(path, correction.index) != path.end();
        break;
      case CorrectedPart::kGrowth:
      case CorrectedPart::kCarried:
        bears = !path.empty();
        break;
      case CorrectedPart::kCamera:
        break;
    }
    if (bears && acts_in(correction, sighting.frame)) out.push_back(static_cast<int>(c));
  }
  return out;
}

std::vector<CorrectionBlock> correction_blocks(const Spec& spec) {
  const auto goes_with = [](const Correction& one, const Correction& other) {
    return one.part == other.part && one.index == other.index && !one.is_local && !other.is_local;
  };
  std::vector<CorrectionBlock> out;
  for (std::size_t c = 0; c < spec.corrections.size(); ++c) {
    if (c > 0 && goes_with(spec.corrections[c - 1], spec.corrections[c])) {
      ++out.back().count;
    } else {
      out.push_back({static_cast<int>(c), 1});
    }
  }
  return out;
}

std::vector<CorrectionBlock> correction_blocks_of(const Spec& spec,
                                                  const std::vector<CorrectionBlock>& blocks,
                                                  const Sighting& sighting) {
  std::vector<CorrectionBlock> out;
  for (const int bearing : corrections_of(spec, sighting)) {
    const auto next = std::ranges::upper_bound(blocks, bearing, {}, &CorrectionBlock::first);
    const CorrectionBlock& block = *std::prev(next);
    if (out.empty() || out.back().first != block.first) out.push_back(block);
  }
  return out;
}

CorrectedSighting sum_corrections(const Spec& spec, const Sighting& sighting,
                                  const std::vector<int>& which,
                                  const std::vector<double>& values) {
  CorrectedSighting out;
  out.joints.assign(path_of(spec, sighting).size(), Vector6d::Zero());
  for (std::size_t k = 0; k < which.size(); ++k) {
    const Correction& correction = spec.corrections[static_cast<std::size_t>(which[k])];
    const Vector6d twist = values[k] * twist_at(correction, sighting.frame);
    const double amount = values[k] * share_at(correction, sighting.frame);
    switch (correction.part) {
      case CorrectedPart::kJoint:
        out.joints[place_on_path(spec, sighting, correction.index)] += twist;
        break;
      case CorrectedPart::kMarker:
        out.marker += twist;
        break;
      case CorrectedPart::kMarkerSize:
      case CorrectedPart::kMarkerWidth:
      case CorrectedPart::kMarkerShear:
      case CorrectedPart::kMarkerWarp:
        number_of(out.shape, correction.part) += amount;
        break;
      case CorrectedPart::kCamera:
        out.camera += twist;
        break;
      case CorrectedPart::kGrowth:
        out.growth.relative += amount;
        break;
      case CorrectedPart::kCarried:
        out.growth.shift_m += twist.tail<3>();
        break;
      case CorrectedPart::kIntrinsic:
        out.intrinsics[static_cast<std::size_t>(correction.index)] += amount;
        break;
      case CorrectedPart::kFocalLength:
        out.intrinsics[0] += amount * model_of(spec, sighting).fx;
        out.intrinsics[1] += amount * model_of(spec, sighting).fy;
        break;
      case CorrectedPart::kBloom:
        out.bloom_px += amount;
        break;
      case CorrectedPart::kReadout:
        out.line_delay_s += amount;
        break;
      case CorrectedPart::kClock:
        break;  // in the readings already
    }
  }
  return out;
}

std::optional<CorrectedError> corrected_error(
    const Spec& spec, const Sighting& sighting, const CorrectedSighting& corrected,
    const Pose& T_camera_base, std::vector<ChainJoint> joints, std::vector<double> rates,
    const Pose& T_link_marker, const CameraModel& camera, const Eigen::Vector3d* target_m) {
  for (std::size_t k = 0; k < joints.size(); ++k) {
    joints[k].correction = corrected.joints[k];
  }
  CorrectedError out;
  out.corrected = corrected;
  out.T_camera_base = exp_pose(corrected.camera) * T_camera_base;
  out.chain =
      differentiate_chain(out.T_camera_base, joints, T_link_marker * exp_pose(corrected.marker));
  if (corrected.growth != Growth{}) grow(corrected.growth, out.T_camera_base, out.chain);
  auto error = compare(sighting, out.chain.T_camera_marker, changed(camera, corrected.intrinsics),
                       target_m, corrected.shape);
  if (!error) return std::nullopt;
  out.error = std::move(*error);
  if (out.error.residual.size() == 2 * std::ssize(sighting.corners_px))
    out.d_bloom = d_bloom(sighting, out.error.residual);
  add_bloom(sighting, corrected.bloom_px, out.error);
  Vector6d velocity = Vector6d::Zero();
  for (std::size_t k = 0; k < joints.size(); ++k) velocity += out.chain.d_value[k] * rates[k];
  out.d_time = out.error.d_marker * velocity;
  out.rates = std::move(rates);
  if (corrected.line_delay_s != 0.0) {
    for (std::size_t i = 0; i < sighting.corners_px.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(2 * i);
      out.error.residual.segment<2>(row) +=
          out.d_time.segment<2>(row) * corrected.line_delay_s * rows_from_middle(spec, sighting, i);
    }
  }
  return out;
}

std::optional<Eigen::VectorXd> corrected_residual(
    const Spec& spec, const Sighting& sighting, const CorrectedSighting& corrected,
    const Pose& T_camera_base, std::vector<ChainJoint> joints, std::vector<double> rates,
    const Pose& T_link_marker, const CameraModel& camera, const Eigen::Vector3d* target_m) {
  // Rows of the image are read one after the other: that moves corners by the slope in time.
  if (corrected.line_delay_s != 0.0) {
    auto at = corrected_error(spec, sighting, corrected, T_camera_base, std::move(joints),
                              std::move(rates), T_link_marker, camera, target_m);
    if (!at) return std::nullopt;
    return std::move(at->error.residual);
  }
  for (std::size_t k = 0; k < joints.size(); ++k) joints[k].correction = corrected.joints[k];
  const Pose corrected_camera = exp_pose(corrected.camera) * T_camera_base;
  Pose T_camera_marker =
      compose_chain(corrected_camera, joints, T_link_marker * exp_pose(corrected.marker));
  if (corrected.growth != Growth{})
    T_camera_marker = grown(corrected.growth, corrected_camera, T_camera_marker);
  auto out = residual_of(sighting, T_camera_marker, changed(camera, corrected.intrinsics), target_m,
                         corrected.shape);
  if (out && corrected.bloom_px != 0.0) *out += corrected.bloom_px * d_bloom(sighting, *out);
  return out;
}

Eigen::VectorXd d_correction(const Spec& spec, const Sighting& sighting,
                             const Correction& correction, const CorrectedError& at) {
  const double share = share_at(correction, sighting.frame);
  const Vector6d twist = twist_at(correction, sighting.frame);
  switch (correction.part) {
    case CorrectedPart::kJoint: {
      const std::size_t k = place_on_path(spec, sighting, correction.index);
      return at.error.d_marker * (at.chain.d_link[k] * moved_behind(at.corrected.joints[k], twist));
    }
    case CorrectedPart::kMarker:
      return at.error.d_marker * (at.chain.d_mount * moved_behind(at.corrected.marker, twist));
    case CorrectedPart::kCamera:
      return at.error.d_marker * (adjoint(at.chain.T_camera_marker.inverse()) *
                                  moved_before(at.corrected.camera, twist));
    case CorrectedPart::kGrowth:
      return share * d_growth(at);
    case CorrectedPart::kCarried:
      return d_carried(at, twist.tail<3>());
    case CorrectedPart::kMarkerSize:
    case CorrectedPart::kMarkerWidth:
    case CorrectedPart::kMarkerShear:
    case CorrectedPart::kMarkerWarp: {
      Eigen::VectorXd out = Eigen::VectorXd::Zero(at.error.residual.size());
      for (std::size_t i = 0; i < sighting.geometry_m.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(2 * i);
        out.segment<2>(row) = at.error.d_marker.block<2, 3>(row, 3) *
                              d_corner(correction.part, sighting.geometry_m[i]) * share;
      }
      return out;
    }
    case CorrectedPart::kIntrinsic:
      return at.error.d_intrinsics.col(correction.index) * share;
    case CorrectedPart::kFocalLength:
      return (at.error.d_intrinsics.col(0) * model_of(spec, sighting).fx +
              at.error.d_intrinsics.col(1) * model_of(spec, sighting).fy) *
             share;
    case CorrectedPart::kBloom:
      return share * at.d_bloom;
    case CorrectedPart::kReadout: {
      Eigen::VectorXd out = at.d_time * share;
      for (std::size_t i = 0; i < sighting.corners_px.size(); ++i) {
        out.segment<2>(static_cast<Eigen::Index>(2 * i)) *= rows_from_middle(spec, sighting, i);
      }
      return out;
    }
    case CorrectedPart::kClock: {
      if (correction.index == kEverywhere) return at.d_time * share;
      const std::size_t k = place_on_path(spec, sighting, correction.index);
      return at.error.d_marker * (at.chain.d_value[k] * (at.rates[k] * share));
    }
  }
  return Eigen::VectorXd::Zero(at.error.residual.size());
}

}  // namespace kinescope::bundle
