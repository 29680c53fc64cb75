// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/check_nominal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr std::size_t kFrames = 40;  // of the recording, spread evenly
constexpr std::size_t kMostFaults = 4;
constexpr double kNoticeable = 1.05;  // enough to look for the next one beside it
constexpr double kBetter = 2.0;       // the typical error is divided by this, at least

// Frames of a measurement that has something in them, thinned out.
template <typename Items, typename FrameOf>
std::set<int> spread_frames(const Items& items, FrameOf frame_of) {
  std::vector<int> frames;
  for (const auto& item : items) frames.push_back(frame_of(item));
  std::ranges::sort(frames);
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  std::set<int> out;
  const std::size_t count = std::min(kFrames, frames.size());
  for (std::size_t k = 0; k < count; ++k) out.insert(frames[k * frames.size() / count]);
  return out;
}

Measurements few_of(Measurements all) {
  const auto frame_of = [](const auto& item) { return item.frame; };
  const std::set<int> corners = spread_frames(all.corners, frame_of);
  std::erase_if(all.corners, [&](const TagObservation& o) { return !corners.contains(o.frame); });
  const std::set<int> points = spread_frames(all.points.observations, frame_of);
  std::erase_if(all.points.observations,
                [&](const PointObservation& o) { return !points.contains(o.frame); });
  std::vector<PoseSample> samples;
  for (const PoseTrack& track : all.poses.tracks)
    samples.insert(samples.end(), track.samples.begin(), track.samples.end());
  const std::set<int> poses = spread_frames(samples, frame_of);
  for (PoseTrack& track : all.poses.tracks)
    std::erase_if(track.samples, [&](const PoseSample& s) { return !poses.contains(s.frame); });
  return all;
}

using Errors = std::map<TagId, TypicalError>;  // of every marker

Errors typical_errors(const Calibration& calibration) {
  struct Lengths {
    std::vector<double> px;
    std::vector<double> m;
    std::vector<double> rad;
  };
  std::map<TagId, Lengths> lengths;
  for (const SightingResidual& residual : calibration.residuals) {
    Lengths& of = lengths[residual.id];
    if (calibration.kind == MeasurementKind::kCorners) {
      double sum = 0.0;
      for (const Eigen::Vector2d& r : residual.corners_px) sum += r.squaredNorm();
      if (!residual.corners_px.empty())
        of.px.push_back(std::sqrt(sum / static_cast<double>(residual.corners_px.size())));
      continue;
    }
    of.m.push_back(residual.displacement.tail<3>().norm());
    if (calibration.kind == MeasurementKind::kPose)
      of.rad.push_back(residual.displacement.head<3>().norm());
  }
  Errors out;
  for (auto& [id, of] : lengths)
    out[id] = {median_of(std::move(of.px)), median_of(std::move(of.m)),
               median_of(std::move(of.rad))};
  return out;
}

// How much smaller the errors are: geometric mean over the parts there are.
double ratio(const TypicalError& from, const TypicalError& to) {
  double sum = 0.0;
  int parts = 0;
  for (const auto& [a, b] : std::array<std::pair<double, double>, 3>{
           {{from.px, to.px}, {from.m, to.m}, {from.rad, to.rad}}}) {
    if (a <= 0.0) continue;
    sum += std::log(a / std::max(b, std::numeric_limits<double>::min()));
    ++parts;
  }
  return parts > 0 ? std::exp(sum / parts) : 1.0;
}

struct Gain {
  double mean = 1.0;     // geometric, over the markers
  double largest = 1.0;  // of one marker: a joint moves those beyond it only
  TagId marker;          // that one
};

Gain gain(const Errors& from, const Errors& to) {
  Gain out;
  double sum = 0.0;
  for (const auto& [id, error] : from) {
    const auto at = to.find(id);
    if (at == to.end()) continue;
    const double smaller = ratio(error, at->second);
    sum += std::log(smaller);
    if (smaller <= out.largest) continue;
    out.largest = smaller;
    out.marker = id;
  }
  if (!from.empty()) out.mean = std::exp(sum / static_cast<double>(from.size()));
  return out;
}

void mend(const NominalFault& fault, KinematicTree& tree) {
  Joint& joint = tree.joints[static_cast<std::size_t>(fault.joint)];
  if (fault.axis) joint.axis = *fault.axis;
  if (fault.zero) {
    const Pose turn{exp_rotation(*fault.zero * joint.axis), Eigen::Vector3d::Zero()};
    joint.T_parent_joint = joint.T_parent_joint * turn;
  }
  if (fault.unit) joint.scale *= *fault.unit;
  if (fault.exchanged_with) {
    Joint& other = tree.joints[static_cast<std::size_t>(*fault.exchanged_with)];
    std::swap(joint.channel, other.channel);
    std::swap(joint.copies, other.copies);
    std::swap(joint.scale, other.scale);
    std::swap(joint.offset, other.offset);
  }
}

// Against the axis, and along the four directions across it that are nearest to the frame's.
std::vector<Eigen::Vector3d> other_directions(const Eigen::Vector3d& axis) {
  std::vector<Eigen::Vector3d> out = {-axis};
  Eigen::Index along = 0;
  axis.cwiseAbs().maxCoeff(&along);
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (k == along) continue;
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(k);
    const Eigen::Vector3d across = (unit - axis.dot(unit) * axis).normalized();
    out.push_back(across);
    out.push_back(-across);
  }
  return out;
}

// Degrees for rad, or mm for m.
double other_unit(JointType type) {
  return type == JointType::kRevolute ? kRadPerDegree : kMetrePerMillimetre;
}

bool is_driven(const Joint& joint) { return is_movable(joint) && !joint.channel.empty(); }

// A log has one unit for angles and one for lengths, mostly.
std::vector<NominalFault> other_units(const KinematicTree& tree, JointType type) {
  std::vector<NominalFault> out;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    if (is_driven(tree.joints[j]) && tree.joints[j].type == type)
      out.push_back({.joint = static_cast<int>(j), .unit = other_unit(type)});
  }
  return out;
}

constexpr double kTurn = 2.0 * std::numbers::pi;
// A zero that is up to half a step away is found by the fit itself.
constexpr int kZeros = 8;  // in a turn

bool can_be_turned(const Joint& joint) {
  return is_driven(joint) && joint.type == JointType::kRevolute;
}

// Plainer ones first: a zero that is a quarter turn off looks like an axis before it that points
// elsewhere.
std::vector<NominalFault> possible_faults(const KinematicTree& tree,
                                          const std::vector<NominalFault>& known, bool zeros) {
  std::vector<NominalFault> out;
  const int joints = static_cast<int>(tree.joints.size());
  const auto is_known = [&](int j, const auto& has) {
    return std::ranges::any_of(known, [&](const NominalFault& fault) {
      return has(fault) && (fault.joint == j || fault.exchanged_with == j);
    });
  };
  const auto has_unit = [](const NominalFault& fault) { return fault.unit.has_value(); };
  const auto has_zero = [](const NominalFault& fault) { return fault.zero.has_value(); };
  const auto has_other = [](const NominalFault& fault) { return !fault.unit && !fault.zero; };
  const auto is_open = [&](int j) {
    return is_driven(tree.joints[static_cast<std::size_t>(j)]) && !is_known(j, has_other);
  };
  for (int j = 0; j < joints && zeros; ++j) {
    if (!can_be_turned(tree.joints[static_cast<std::size_t>(j)]) || is_known(j, has_zero)) continue;
    for (int k = 1; k < kZeros; ++k) out.push_back({.joint = j, .zero = kTurn * k / kZeros});
  }
  for (int j = 0; j < joints; ++j) {
    const Joint& joint = tree.joints[static_cast<std::size_t>(j)];
    if (is_driven(joint) && !is_known(j, has_unit))
      out.push_back({.joint = j, .unit = other_unit(joint.type)});
    if (!is_open(j)) continue;
    for (const Eigen::Vector3d& axis : other_directions(joint.axis))
      out.push_back({.joint = j, .axis = axis});
    for (int k = j + 1; k < joints; ++k) {
      if (is_open(k) && tree.joints[static_cast<std::size_t>(k)].type == joint.type)
        out.push_back({.joint = j, .exchanged_with = k});
    }
  }
  return out;
}

CalibrateOptions quick_options() {
  CalibrateOptions options;
  options.free = FreeGeometry::kGeometry;  // whose prior bears a joint without a marker
  options.estimate_time_offset = false;
  options.folds = 0;
  options.max_iterations = 30;
  return options;
}

struct Trial {
  CalibrationStart start;
  Errors errors;
};

// How far a joint's frame was turned about its axis, of the whole turn nearest to none.
double turn_between(const Joint& from, const Joint& to) {
  const Eigen::Quaterniond q = (from.T_parent_joint.inverse() * to.T_parent_joint).rotation;
  return std::remainder(2.0 * std::atan2(q.vec().dot(from.axis), q.w()), kTurn);
}

// The faults with the zeros where a fit puts them that frees nothing else of the robot.
std::vector<NominalFault> with_fitted_zeros(const std::vector<NominalFault>& faults,
                                            const KinematicTree& start,
                                            const KinematicTree& fitted) {
  std::vector<NominalFault> out;
  std::vector<double> zeros(start.joints.size(), 0.0);
  for (const NominalFault& fault : faults) {
    if (fault.zero) {
      zeros[static_cast<std::size_t>(fault.joint)] = *fault.zero;
    } else {
      out.push_back(fault);
    }
  }
  for (std::size_t j = 0; j < zeros.size(); ++j) {
    if (!can_be_turned(start.joints[j])) continue;
    const double zero =
        std::remainder(zeros[j] + turn_between(start.joints[j], fitted.joints[j]), kTurn);
    if (std::abs(zero) > 0.5 * kTurn / kZeros)
      out.push_back({.joint = static_cast<int>(j), .zero = zero});
  }
  return out;
}

std::string length_words(double length, bool px) {
  return px ? fmt::format("{:.0f} px", length) : fmt::format("{:.1f} mm", 1e3 * length);
}

// Distances of the sightings of every marker from their mean: corners in px, places in m.
std::map<TagId, double> typical_motions(const Measurements& measurements) {
  std::map<TagId, std::vector<Eigen::VectorXd>> places;
  for (const TagObservation& seen : measurements.corners) {
    Eigen::VectorXd corners(2 * static_cast<Eigen::Index>(seen.corners_px.size()));
    for (std::size_t i = 0; i < seen.corners_px.size(); ++i) {
      corners.segment<2>(2 * static_cast<Eigen::Index>(i)) = seen.corners_px[i];
    }
    // Root mean square over the corners, as an error is.
    places[seen.id].emplace_back(corners / std::sqrt(static_cast<double>(seen.corners_px.size())));
  }
  for (const PoseTrack& track : measurements.poses.tracks) {
    for (const PoseSample& sample : track.samples)
      places[track.id].emplace_back(sample.T_camera_marker.translation);
  }
  for (const PointObservation& point : measurements.points.observations) {
    if (point.position_m) places[point.id].emplace_back(*point.position_m);
  }
  std::map<TagId, double> out;
  for (const auto& [id, all] : places) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(all.front().size());
    for (const Eigen::VectorXd& place : all) mean += place / static_cast<double>(all.size());
    std::vector<double> away;
    for (const Eigen::VectorXd& place : all) away.push_back((place - mean).norm());
    out[id] = median_of(std::move(away));
  }
  return out;
}

// The declared noise of every marker's sightings as a length: px of a corner, m of a place.
std::map<TagId, double> typical_noise(const Measurements& measurements) {
  std::map<TagId, std::vector<double>> all;
  for (const TagObservation& seen : measurements.corners)
    all[seen.id].push_back(std::sqrt(2.0) * seen.sigma_px);
  for (const PoseTrack& track : measurements.poses.tracks) {
    for (const PoseSample& sample : track.samples)
      all[track.id].push_back(std::sqrt(sample.covariance.bottomRightCorner<3, 3>().trace()));
  }
  for (const PointObservation& point : measurements.points.observations)
    all[point.id].push_back(std::sqrt(3.0) * point.sigma_m);
  std::map<TagId, double> out;
  for (auto& [id, sigmas] : all) out[id] = median_of(std::move(sigmas));
  return out;
}

constexpr double kNoise = 5.0;  // times the declared one: the robot misses a marker

double length_of(const TypicalError& error) { return error.px > 0.0 ? error.px : error.m; }

bool misses_a_marker(const Errors& errors, const Measurements& measurements) {
  const std::map<TagId, double> noise = typical_noise(measurements);
  return std::ranges::any_of(
      errors, [&](const auto& of) { return length_of(of.second) > kNoise * noise.at(of.first); });
}

// A marker that the robot moves far and yet misses by a share of that: no drawing's inaccuracy, but
// another robot, other columns or other units.
void require_fit(const Errors& errors, const Measurements& measurements) {
  constexpr double kGross = 0.2;  // of its motion
  constexpr double kFar = 0.2;    // of the motion of the marker that moves most
  const std::map<TagId, double> motions = typical_motions(measurements);
  const std::map<TagId, double> noise = typical_noise(measurements);
  double most = 0.0;
  for (const auto& [id, motion] : motions) most = std::max(most, motion);
  for (const auto& [id, motion] : motions) {
    const auto error = errors.find(id);
    if (error == errors.end() || motion < kFar * most) continue;
    const double missed = length_of(error->second);
    if (missed < std::max(kGross * motion, kNoise * noise.at(id))) continue;
    const bool corners = error->second.px > 0.0;
    throw undetermined(
        "nominal robot",
        fmt::format("it does not fit with these columns: tag_{} is typically {} from where it "
                    "should be, and moves by {}",
                    id.value, length_words(missed, corners), length_words(motion, corners)),
        "check that the columns are named like the joints that they drive, their units, and that "
        "the URDF is this robot's; kinescope run without --nominal shows what each column moves");
  }
}

using Faults = std::vector<NominalFault>;

Faults with(Faults faults, const NominalFault& another) {
  faults.push_back(another);
  return faults;
}

class FaultSearch {
 public:
  FaultSearch(const KinematicTree& nominal,
              const std::function<CalibrationStart(const KinematicTree&)>& place,
              const Measurements& measurements, const MarkerSet& markers, const JointLog& log)
      : nominal_(nominal),
        place_(place),
        few_(few_of(measurements)),
        markers_(markers),
        log_(log),
        now_(try_out({})) {}

  CheckedNominal result() {
    change_units();
    if (!now_) return {place_(nominal_), {}};
    // Beside another fault the first one found may help little.
    for (std::size_t most = faults_.size() + kMostFaults; faults_.size() < most;) {
      if (!add_best()) break;
    }
    fit_zeros();
    drop_useless();
    require_fit(now_->errors, few_);
    return {std::move(now_->start), std::move(faults_)};
  }

 private:
  [[nodiscard]] std::optional<Trial> try_out(const Faults& faults) const {
    KinematicTree tree = nominal_;
    for (const NominalFault& fault : faults) mend(fault, tree);
    try {
      Trial trial{place_(tree), {}};
      trial.errors = typical_errors(calibrate(few_, markers_, log_, trial.start, quick_options()));
      return trial;
    } catch (const Error&) {  // cannot be placed: no answer
      return std::nullopt;
    }
  }

  void change_units() {
    for (const JointType type : {JointType::kRevolute, JointType::kPrismatic}) {
      Faults more = faults_;
      std::ranges::copy(other_units(nominal_, type), std::back_inserter(more));
      std::optional<Trial> trial = more.size() > faults_.size() ? try_out(more) : std::nullopt;
      if (!trial || (now_ && gain(now_->errors, trial->errors).mean < kBetter)) continue;
      faults_ = std::move(more);
      now_ = std::move(trial);
    }
  }

  bool add_best() {
    std::optional<NominalFault> best;
    std::optional<Trial> best_trial;
    const bool zeros = misses_a_marker(now_->errors, few_);
    for (const NominalFault& fault : possible_faults(nominal_, faults_, zeros)) {
      std::optional<Trial> trial = try_out(with(faults_, fault));
      const double least = best && best->zero && !fault.zero ? kNoticeable : 1.0;
      if (!trial || gain((best_trial ? *best_trial : *now_).errors, trial->errors).mean <= least)
        continue;
      best = fault;
      best_trial = std::move(trial);
    }
    if (!best) return false;
    const Gain won = gain(now_->errors, best_trial->errors);
    if (won.mean < kNoticeable && won.largest < kBetter) return false;
    faults_.push_back(*best);
    now_ = std::move(best_trial);
    return true;
  }

  void fit_zeros() {
    if (std::ranges::none_of(faults_, [](const auto& fault) { return fault.zero.has_value(); }))
      return;
    CalibrateOptions options = quick_options();
    options.free = FreeGeometry::kOffsets;
    const Calibration fitted = calibrate(few_, markers_, log_, now_->start, options);
    Faults others = with_fitted_zeros(faults_, now_->start.tree, fitted.tree);
    std::optional<Trial> trial = try_out(others);
    if (!trial || gain(trial->errors, now_->errors).mean > kNoticeable) return;
    faults_ = std::move(others);
    now_ = std::move(trial);
  }

  // With all in, each must be worth it.
  void drop_useless() {
    for (std::size_t i = faults_.size(); i-- > 0;) {
      Faults others = faults_;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      std::optional<Trial> without = try_out(others);
      if (!without) continue;
      const Gain won = gain(without->errors, now_->errors);
      if (won.largest >= kBetter) {
        faults_[i].marker = won.marker;
        faults_[i].before = without->errors.at(won.marker);
        faults_[i].after = now_->errors.at(won.marker);
        continue;
      }
      faults_ = std::move(others);
      now_ = std::move(without);
    }
  }

  const KinematicTree& nominal_;
  const std::function<CalibrationStart(const KinematicTree&)>& place_;
  Measurements few_;
  const MarkerSet& markers_;
  const JointLog& log_;
  Faults faults_;
  std::optional<Trial> now_;  // with these faults mended
};

}  // namespace

CheckedNominal check_nominal(const KinematicTree& nominal,
                             const std::function<CalibrationStart(const KinematicTree&)>& place,
                             const Measurements& measurements, const MarkerSet& markers,
                             const JointLog& log) {
  return FaultSearch(nominal, place, measurements, markers, log).result();
}

}  // namespace kinescope
