// SPDX-License-Identifier: Apache-2.0
#include "app/commands/carry_over.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "app/commands/run_again.h"
#include "app/commands/run_folder.h"
#include "app/explain/pipeline.h"
#include "calib/bundle/place_markers.h"
#include "calib/effects/corrected_log.h"
#include "calib/trace/held_out.h"
#include "kinematics/core/csv.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// A held-out error this much above that of the recording's own model is no worse in use: what the
// README asks of held-out against training errors, too.
constexpr double kNoWorse = 1.1;
// Stretches of time where the run did not say how many are independent: as few as a scatter needs
// (calib/bundle/uncertainty.cpp).
constexpr int kFewStretches = 12;

// A sighting, or of corners one corner of it.
struct Place {
  double time_s = 0.0;
  int id = 0;
  int corner = 0;
  auto operator<=>(const Place&) const = default;
};

struct OwnErrors {
  std::map<Place, double> squared;  // of used sightings, px^2 or m^2
  std::map<double, int> fold;       // of every frame
};

OwnErrors read_own_errors(const fs::path& residuals_csv) {
  const CsvTable table = read_csv(residuals_csv);
  const bool corners = table.column("corner").has_value();
  const std::size_t time = table.require_column("t");
  const std::size_t id = table.require_column(corners ? "tag" : "body");
  const std::size_t used = table.require_column("used");
  const std::size_t fold = table.require_column("fold");
  std::vector<std::size_t> parts;
  for (const char* name : {"held_out_du", "held_out_dv"})
    if (corners) parts.push_back(table.require_column(name));
  for (const char* name : {"held_out_x", "held_out_y", "held_out_z"})
    if (!corners) parts.push_back(table.require_column(name));
  OwnErrors out;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const double t = table.number(row, time);
    out.fold[t] = table.integer(row, fold);
    if (table.integer(row, used) == 0) continue;
    double squared = 0.0;
    bool known = true;
    for (const std::size_t part : parts) {
      const auto value = table.optional_number(row, part);
      known = known && value.has_value();
      squared += value.value_or(0.0) * value.value_or(0.0);
    }
    const int corner = corners ? table.integer(row, table.require_column("corner")) : 0;
    if (known) out.squared[{t, table.integer(row, id), corner}] = squared;
  }
  return out;
}

// The recording of a run as it was measured, and its marker tracks.
struct Remeasured {
  RunOptions options;
  Recording recording;
  Measurements measurements;
  PoseTracks tracks;  // empty for points
};

Remeasured recording_again(const StoredRun& run) {
  Remeasured out;
  out.options = options_of_run(run.folder);
  if (!out.options.further.empty()) {
    throw bad_input(run.folder.string(),
                    "it is of several recordings, on which models are not tried",
                    "compare runs of one recording each");
  }
  out.recording = read_recording(out.options.recording);
  require_same_inputs(run.folder, out.recording);
  if (!out.recording.cameras.empty()) {
    throw bad_input(run.folder.string(),
                    "its recording is of several cameras, on which models are not tried",
                    "compare runs of one of its cameras (--video, --corners)");
  }
  if (run.calibration.moving) {
    throw bad_input(run.folder.string(),
                    "its camera moves, and models are tried on recordings of fixed cameras",
                    "compare the numbers alone, or runs of a camera at rest");
  }
  std::optional<TagObservations> kept;
  if (out.recording.entry == RecordingEntry::kVideo)
    kept = read_corners(run.folder / "observations.csv", out.recording.markers);
  out.measurements =
      observe(out.recording, out.options, out.recording.camera, kept, {}).measurements;
  if (out.recording.entry != RecordingEntry::kPoints)
    out.tracks = read_poses(run.folder / "tracks.csv").found;
  return out;
}

std::string effect_joint(const FittedEffect& effect, const KinematicTree& tree) {
  return tree.joint(effect.id.place) ? effect.id.place : std::string();
}

// The model without markers, its joints driven by the channels of the recording, in its units.
KinematicTree driven_by(const StoredRun& model, const StoredRun& onto, const RobotMatch& match) {
  KinematicTree out = model.calibration.tree;
  out.markers.clear();
  std::map<std::string, std::pair<std::string, double>> renamed;  // and units of it in one of ours
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    if (match.joint_of[j] < 0) continue;
    const Joint& there = onto.calibration.tree.joints[static_cast<std::size_t>(match.joint_of[j])];
    renamed[out.joints[j].channel] = {there.channel, match.reading_ratio[j]};
    out.joints[j].channel = there.channel;
    out.joints[j].copies = there.copies;
    out.joints[j].scale /= match.reading_ratio[j];
  }
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    for (ChannelShare& share : out.joints[j].couplings) {
      const auto found = renamed.find(share.channel);
      if (found == renamed.end()) continue;
      share.channel = found->second.first;
      share.ratio *= match.reading_ratio[j] / found->second.second;
    }
  }
  return out;
}

// What the model's joints do, its effects included, as a log with a column a joint: nothing of it
// is left to estimate.
JointLog joint_values_of(const StoredRun& model, const KinematicTree& tree, const JointLog& log) {
  std::vector<FittedEffect> at_joints;
  for (const FittedEffect& effect : model.effects.effects)
    if (!effect_joint(effect, tree).empty()) at_joints.push_back(effect);
  const JointLog without = corrected_log(log, tree, at_joints, model.effects.gravity_base).log;
  JointLog out;
  out.source = log.source;
  out.times_s = without.times_s;
  out.values.resize(std::ssize(out.times_s), std::ssize(tree.joints));
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const auto column = static_cast<Eigen::Index>(j);
    out.channels.push_back(joint.name);
    out.values.col(column).setZero();
    if (joint.type == JointType::kFixed) continue;
    const auto reading = [&](const std::string& channel) -> Eigen::VectorXd {
      const auto at = without.channel(channel);
      if (!at) {
        throw bad_input(log.source, fmt::format("has no column '{}'", channel),
                        "record the channels that drive the joints");
      }
      return without.values.col(*at);
    };
    Eigen::VectorXd sum = reading(joint.channel);
    for (const ChannelShare& share : joint.couplings) sum += share.ratio * reading(share.channel);
    out.values.col(column) = (joint.scale * sum).array() + joint.offset;
  }
  return out;
}

KinematicTree with_own_columns(KinematicTree tree) {
  for (Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    joint.channel = joint.name;
    joint.scale = 1.0;
    joint.offset = 0.0;
    joint.couplings.clear();
    joint.copies.clear();
  }
  return tree;
}

// The joint that moves a link; -1: it rests.
int mover_of(const KinematicTree& tree, LinkId link) {
  auto above = tree.parent_joint(link);
  while (above && tree.joints[above->index()].type == JointType::kFixed)
    above = tree.parent_joint(tree.joints[above->index()].parent);
  return above ? above->value : -1;
}

// The model's link that carries a marker of the recording: `placed`, where that moves alike.
LinkId link_of(const Marker& marker, LinkId placed, const StoredRun& onto,
               const KinematicTree& model, const RobotMatch& match) {
  const int there = mover_of(onto.calibration.tree, marker.link);
  const auto own = std::ranges::find(match.joint_of, there) - match.joint_of.begin();
  const int here = there < 0 ? -1 : static_cast<int>(own);
  if (mover_of(model, placed) == here) return placed;
  return here < 0 ? LinkId{0} : model.joints[static_cast<std::size_t>(here)].child;
}

// Where a marker sits by its sighting in the middle of its track.
std::optional<Pose> mount_by_track(const PoseTracks& tracks, const KinematicTree& model,
                                   const Eigen::MatrixXd& values, const Pose& T_camera_base,
                                   TagId id, LinkId link) {
  for (const PoseTrack& track : tracks.tracks) {
    if (track.id != id || track.samples.empty()) continue;
    const PoseSample& sample = track.samples[track.samples.size() / 2];
    const Eigen::VectorXd q = values.row(sample.frame);
    if (!q.allFinite()) return std::nullopt;
    const Pose T_base_link = forward_kinematics(model, q)[link.index()];
    return (T_camera_base * T_base_link).inverse() * sample.T_camera_marker;
  }
  return std::nullopt;
}

// Camera and markers by the model; each marker on the link that its own run found.
CalibrationStart placed_start(const Remeasured& seen, const StoredRun& onto,
                              const KinematicTree& model, const JointLog& log,
                              const RobotMatch& match) {
  const bool points = seen.recording.entry == RecordingEntry::kPoints;
  const std::vector<double>& times_s = points ? seen.measurements.times_s : seen.tracks.times_s;
  const Eigen::MatrixXd values = resample(log, times_s, onto.calibration.time_offset_s);
  const Placement placement = points ? place_points(model, values, seen.measurements.points)
                                     : place_markers(model, values, seen.tracks);
  CalibrationStart out;
  out.tree = model;
  out.camera = onto.calibration.camera;
  out.T_camera_base = placement.T_camera_base;
  out.time_offset_s = onto.calibration.time_offset_s;
  out.nominal = true;
  for (const Marker& known : onto.calibration.tree.markers) {
    const auto placed = std::ranges::find(placement.markers, known.id, &Marker::id);
    if (placed == placement.markers.end()) continue;
    Marker marker = *placed;
    const LinkId link = link_of(known, placed->link, onto, model, match);
    if (marker.link != link) {
      const auto mount =
          mount_by_track(seen.tracks, model, values, out.T_camera_base, known.id, link);
      if (!mount) continue;
      marker.link = link;
      marker.T_link_marker = *mount;
    }
    marker.size_m = known.size_m;
    out.tree.markers.push_back(marker);
  }
  return out;
}

// Folds as its own run had them, frames without a sighting with the one before.
std::vector<int> same_folds(const std::vector<double>& times_s, const OwnErrors& own, int& folds) {
  std::vector<int> out;
  int last = 0;
  folds = 0;
  for (const double t : times_s) {
    const auto found = own.fold.find(t);
    if (found != own.fold.end() && found->second >= 0) last = found->second;
    folds = std::max(folds, last + 1);
    out.push_back(last);
  }
  return out;
}

// Sums of squares over the same sightings, by frame.
struct PairedErrors {
  std::vector<double> own, carried;
  double count = 0.0;
};

PairedErrors paired(const OwnErrors& own, const Calibration& carried) {
  std::map<double, std::pair<double, double>> by_time;
  PairedErrors out;
  const auto add = [&](const Place& place, double squared) {
    const auto found = own.squared.find(place);
    if (found == own.squared.end() || !std::isfinite(squared)) return;
    auto& [first, second] = by_time[place.time_s];
    first += found->second;
    second += squared;
    out.count += 1.0;
  };
  for (const SightingResidual& r : carried.residuals) {
    const double t = carried.times_s[static_cast<std::size_t>(r.frame)];
    for (std::size_t c = 0; c < r.held_out_px.size(); ++c)
      add({t, r.id.value, static_cast<int>(c)}, r.held_out_px[c].squaredNorm());
    if (carried.kind != MeasurementKind::kCorners)
      add({t, r.id.value, 0}, r.held_out_displacement.tail<3>().squaredNorm());
  }
  for (const auto& [time_s, sums] : by_time) {
    out.own.push_back(sums.first);
    out.carried.push_back(sums.second);
  }
  return out;
}

double p_of_no_worse(const PairedErrors& errors, int stretches) {
  const auto n = std::ssize(errors.own);
  trace::Partition partition;
  partition.stretches = static_cast<int>(std::min<std::ptrdiff_t>(n, stretches));
  for (std::ptrdiff_t i = 0; i < n; ++i)
    partition.stretch.push_back(static_cast<int>(i * partition.stretches / n));
  return trace::paired_p_value(partition,
                               Eigen::Map<const Eigen::VectorXd>(errors.carried.data(), n),
                               Eigen::Map<const Eigen::VectorXd>(errors.own.data(), n));
}

double rms_of(const std::vector<double>& squares, double count) {
  double sum = 0.0;
  for (const double square : squares) sum += square;
  return std::sqrt(sum / count);
}

CarriedOver tried(const StoredRun& model, const StoredRun& onto, const RobotMatch& match,
                  double level) {
  CarriedOver out;
  for (std::size_t j = 0; j < match.own_unit.size(); ++j) {
    if (!match.own_unit[j]) continue;
    out.skipped = fmt::format("the log counts {} in another unit, from a zero of its own",
                              model.calibration.tree.joints[j].name);
    return out;
  }
  const Remeasured seen = recording_again(onto);
  const OwnErrors own = read_own_errors(onto.folder / "residuals.csv");
  const KinematicTree driven = driven_by(model, onto, match);
  const JointLog log = joint_values_of(model, driven, seen.recording.log);
  const KinematicTree tree = with_own_columns(driven);
  const CalibrationStart start = placed_start(seen, onto, tree, log, match);
  CalibrateOptions options = seen.options.calibrate;
  options.free = FreeGeometry::kPlacement;
  options.estimate_intrinsics = false;
  options.estimate_scales = false;
  options.fold_of_frame = same_folds(seen.measurements.times_s, own, options.folds);
  if (options.folds < 2) {
    out.skipped = "its run held nothing out (--folds 0)";
    return out;
  }
  const Calibration carried =
      calibrate(seen.measurements, seen.recording.markers, log, start, options);
  const PairedErrors errors = paired(own, carried);
  if (errors.own.empty()) {
    out.skipped = "none of its sightings could be predicted";
    return out;
  }
  out.unit = carried.kind == MeasurementKind::kCorners ? "px" : "m";
  out.own_rms = rms_of(errors.own, errors.count);
  out.carried_rms = rms_of(errors.carried, errors.count);
  const int known = onto.trace ? onto.trace->stretches : 0;
  out.p_value = p_of_no_worse(errors, known > 2 ? known : kFewStretches);
  out.carries = out.p_value >= level || out.carried_rms <= kNoWorse * out.own_rms;
  return out;
}

}  // namespace

CarriedOver carry_over(const StoredRun& model, const StoredRun& onto, const RobotMatch& match,
                       double level) {
  try {
    return tried(model, onto, match, level);
  } catch (const Error& error) {
    CarriedOver out;
    out.skipped = error.what();
    return out;
  }
}

}  // namespace kinescope
