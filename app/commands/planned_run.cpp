// SPDX-License-Identifier: Apache-2.0
#include "app/commands/planned_run.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/compared_runs.h"
#include "app/commands/run_again.h"
#include "app/io/recording.h"
#include "calib/bundle/postures.h"
#include "calib/camera/marker_set.h"
#include "calib/effects/joint_shares.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/median.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// Of the markers that a run found, the few most oblique and smallest are no promise.
constexpr double kFew = 0.01;
// Half of the time over which speeds and accelerations are taken from a log: encoders are noisy.
constexpr double kHalf_s = 0.1;
// Highest speed and acceleration: this share of the log is below.
constexpr double kNearlyAll = 0.99;
// A marker at rest whose residuals have less than this share of the others' variance: what else it
// errs by is the same in all frames (as the uncertainty of the bundle has it).
constexpr double kMostOfOneError = 0.5;

double quantile_of(std::vector<double> values, double share) {
  std::ranges::sort(values);
  const auto last = static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(std::lround(share * last))];
}

void require_fixed_camera(const fs::path& folder, const Calibration& calibration) {
  if (calibration.kind != MeasurementKind::kCorners) {
    throw bad_input(folder.string(),
                    "its recording is of poses or points, not of a camera's images",
                    "plan for a run of a video, images or corners.csv");
  }
  if (calibration.moving) {
    throw bad_input(folder.string(), "its camera moves, and plans are for cameras at rest",
                    "plan for a run of a fixed camera");
  }
}

// A promise is no better than the covariance that it begins with.
void require_covariance(const fs::path& folder, const Calibration& calibration) {
  if (!calibration.noise_widening) {
    throw bad_input((folder / "calibration.json").string(),
                    "it does not say noise_widening: it is of an earlier version",
                    "run the recording again");
  }
  constexpr double kDigits = 1e-6;  // of the file
  bool of_robot = false;
  for (std::size_t i = 0; i < calibration.parameters.size(); ++i) {
    const Parameter& parameter = calibration.parameters[i];
    const auto at = static_cast<Eigen::Index>(i);
    of_robot = of_robot || (parameter.sigma && calibration.tree.joint(parameter.block));
    if (!parameter.sigma) continue;
    const double variance = *parameter.sigma * *parameter.sigma;
    if (std::abs(calibration.covariance(at, at) - variance) > kDigits * variance)
      throw bad_input((folder / "calibration.json").string(),
                      "its covariance contradicts the sigma of " + parameter.name,
                      "run the recording again");
  }
  // Zeros that only their sums with markers are known of: what those sums say would be lost.
  for (const Joint& joint : calibration.tree.joints) {
    const auto zero =
        std::ranges::find(calibration.parameters, joint.name + " offset", &Parameter::name);
    if (zero == calibration.parameters.end() || zero->sigma) continue;
    throw undetermined(
        folder.string(),
        fmt::format("it does not tell the zero of {} from its marker's place", joint.name),
        "run it with --free geometry");
  }
  if (!of_robot) {
    throw undetermined(folder.string(), "the run knows nothing of the robot's joints to build on",
                       "run it with --free geometry");
  }
}

// Corner noise by marker, and the rate of the frames.
struct SeenCorners {
  design::MarkerNoise noise;
  std::vector<double> times_s;
};

SeenCorners read_seen_corners(const fs::path& residuals_csv, const Calibration& calibration) {
  const CsvTable table = read_csv(residuals_csv);
  const std::size_t time = table.require_column("t"), tag = table.require_column("tag"),
                    used = table.require_column("used"), du = table.require_column("du"),
                    dv = table.require_column("dv");
  std::map<TagId, std::pair<double, double>> squares;  // sum, count
  std::pair<double, double> all;
  auto column = table.column("camera");
  if (!column) column = table.column("recording");
  std::set<double> times;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    // Each has times of its own: those of the reference camera, or of the first recording.
    if (!column || table.rows[row][*column] == calibration.camera_name)
      times.insert(table.number(row, time));
    const auto x = table.optional_number(row, du), y = table.optional_number(row, dv);
    if (table.integer(row, used) == 0 || !x || !y) continue;
    auto& one = squares[TagId{table.integer(row, tag)}];
    for (auto* sum : {&one, &all}) {
      sum->first += *x * *x + *y * *y;
      sum->second += 2.0;
    }
  }
  if (!(all.first > 0.0)) {
    throw bad_input(residuals_csv.string(), "it has no residuals",
                    "give the folder of a finished run");
  }
  SeenCorners out;
  out.times_s.assign(times.begin(), times.end());
  out.noise.all_px = std::sqrt(all.first / all.second);
  for (const auto& [id, sum] : squares)
    if (sum.first > 0.0) out.noise.of_marker[id] = std::sqrt(sum.first / sum.second);
  for (const auto& [id, noise] : out.noise.of_marker) {
    const Marker* marker = calibration.tree.marker(id);
    const bool rests = marker != nullptr && marker->link == LinkId{0};
    if (rests && noise * noise < kMostOfOneError * out.noise.all_px * out.noise.all_px)
      out.noise.at_rest.insert(id);
  }
  return out;
}

double rate_of(const std::vector<double>& times_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times_s.size(); ++i) steps.push_back(times_s[i] - times_s[i - 1]);
  return steps.empty() ? 0.0 : 1.0 / median_of(std::move(steps));
}

// No more oblique and no smaller than markers were found in the run, within what a detector takes.
design::SightLimits seen_limits(const fs::path& tracks_csv, const Calibration& calibration) {
  std::vector<double> tilts, edges;
  for (const PoseTrack& track : read_poses(tracks_csv).found.tracks) {
    const Marker* marker = calibration.tree.marker(track.id);
    if (marker == nullptr || !(marker->size_m > 0.0)) continue;
    for (const PoseSample& sample : track.samples) {
      std::vector<Eigen::Vector2d> corners;
      for (const Eigen::Vector3d& corner : square_corners(marker->size_m))
        if (const auto pixel = project(calibration.camera, sample.T_camera_marker * corner))
          corners.push_back(*pixel);
      if (corners.size() < 4) continue;
      tilts.push_back(design::tilt_of(sample.T_camera_marker));
      edges.push_back(design::shortest_edge_px(corners));
    }
  }
  design::SightLimits out;
  if (tilts.empty()) return out;
  out.most_tilt_rad = std::min(out.most_tilt_rad, quantile_of(std::move(tilts), 1.0 - kFew));
  out.least_edge_px = std::max(out.least_edge_px, quantile_of(std::move(edges), kFew));
  return out;
}

// What the run recorded of each joint, widened about its middle.
design::MotionLimits recorded_limits(const Calibration& calibration, double range) {
  design::MotionLimits out;
  for (const JointEstimate& joint : calibration.joints) {
    const double middle = 0.5 * (joint.range.lower + joint.range.upper);
    const double half = 0.5 * range * (joint.range.upper - joint.range.lower);
    out.range.push_back({middle - half, middle + half});
  }
  const auto joints = std::ssize(calibration.joints);
  out.velocity = Eigen::VectorXd::Ones(joints);
  out.acceleration = Eigen::VectorXd::Ones(joints);
  return out;
}

// Ranges and highest speeds of a URDF's joints of the same names.
void take_urdf_limits(const fs::path& urdf, const Calibration& calibration,
                      design::MotionLimits& limits, std::vector<std::string>& warnings) {
  const KinematicTree declared = read_urdf(urdf);
  std::vector<std::string> names, unlimited;
  int found = 0;
  for (std::size_t j = 0; j < calibration.tree.joints.size(); ++j) {
    const Joint& joint = calibration.tree.joints[j];
    if (joint.type == JointType::kFixed) continue;
    names.push_back(joint.name);
    const auto own = declared.joint(joint.name);
    if (!own) {
      unlimited.push_back(joint.name);
      continue;
    }
    ++found;
    const Joint& there = declared.joints[own->index()];
    if (there.type != joint.type) {
      throw bad_input(urdf.string(), joint.name + " is of another type there than in the run",
                      "give the URDF of this robot, its joints named as in the run");
    }
    if (there.velocity && !(*there.velocity > 0.0)) {
      throw bad_input(urdf.string(), joint.name + " may not move: its velocity is 0",
                      "give its highest speed, rad/s or m/s");
    }
    if (there.velocity) {
      const auto at = static_cast<Eigen::Index>(j);
      limits.velocity[at] = std::min(limits.velocity[at], *there.velocity);
    }
    if (!there.limits) {
      unlimited.push_back(joint.name);
      continue;
    }
    limits.range[j] = *there.limits;
    const JointLimits& recorded = calibration.joints[j].range;
    if (recorded.lower < there.limits->lower || recorded.upper > there.limits->upper)
      warnings.push_back(
          fmt::format("{} was recorded beyond the limits that {} declares: are its "
                      "zero and unit those of the log?",
                      joint.name, urdf.filename().string()));
  }
  if (found > 0 && !unlimited.empty()) {
    warnings.push_back(fmt::format("{} declares no range of {}: what the run recorded is taken",
                                   urdf.filename().string(), fmt::join(unlimited, ", ")));
  }
  if (found == 0) {
    throw bad_input(
        urdf.string(),
        fmt::format("no joint of it is named as one of the run's ({})", fmt::join(names, ", ")),
        "give the URDF of this robot, its joints named as in the run");
  }
}

// Highest speeds and accelerations of the joints in a log, from differences over kHalf_s.
void take_recorded_speeds(const JointLog& log, const KinematicTree& tree, double speed,
                          design::MotionLimits& limits) {
  const JointMotion motion = effects::motion_of(log, tree);
  JointLog by_joint;
  by_joint.times_s = log.times_s;
  by_joint.values = motion.value;
  for (const Joint& joint : tree.joints) by_joint.channels.push_back(joint.name);
  const Eigen::MatrixXd before = resample(by_joint, log.times_s, -kHalf_s);
  const Eigen::MatrixXd after = resample(by_joint, log.times_s, kHalf_s);
  for (Eigen::Index j = 0; j < motion.value.cols(); ++j) {
    std::vector<double> rates, bends;
    for (Eigen::Index i = 0; i < motion.value.rows(); ++i) {
      const double rate = std::abs(after(i, j) - before(i, j)) / (2.0 * kHalf_s);
      if (!std::isfinite(rate)) continue;
      rates.push_back(rate);
      bends.push_back(std::abs(after(i, j) - 2.0 * motion.value(i, j) + before(i, j)) /
                      (kHalf_s * kHalf_s));
    }
    if (rates.empty()) continue;
    limits.velocity[j] = speed * quantile_of(std::move(rates), kNearlyAll);
    limits.acceleration[j] = speed * speed * quantile_of(std::move(bends), kNearlyAll);
  }
}

// The log of the run's (first) recording; nothing, and why, where it is gone.
std::optional<JointLog> recorded_log(const fs::path& folder, std::string& why_not) {
  try {
    return read_recording(options_of_run(folder).recording).log;
  } catch (const Error& error) {
    why_not = error.what();
    return std::nullopt;
  }
}

// Joints that stood still in the log, whose speed nobody knows.
std::string still_joints(const KinematicTree& tree, const design::MotionLimits& limits) {
  std::vector<std::string> out;
  for (std::size_t j = 0; j < tree.joints.size(); ++j)
    if (is_movable(tree.joints[j]) && !(limits.velocity[static_cast<Eigen::Index>(j)] > 0.0 &&
                                        limits.acceleration[static_cast<Eigen::Index>(j)] > 0.0))
      out.push_back(tree.joints[j].name);
  return fmt::format("{}", fmt::join(out, ", "));
}

design::ConsideredEffect considered(const FittedEffect& effect) {
  return {effect.id, effect.scan, effect.values, effect.references};
}

// A curve's many numbers mean nothing to another recording: what it says is held.
void take_known_effects(const StoredRun& run, PlannedRun& out) {
  std::map<EffectId, std::size_t> place, rival;
  for (const FittedEffect& effect : run.effects.effects) {
    if (effect.table_shares.size() > 0) continue;
    place[effect.id] = out.robot.effects.size();
    out.robot.effects.push_back(considered(effect));
  }
  out.robot.gravity_base = run.effects.gravity_base;
  if (!run.trace) return;
  for (const std::vector<EffectId>& rivals : run.trace->ambiguous) {
    const auto believed = rivals.empty() ? place.end() : place.find(rivals.front());
    if (believed == place.end()) continue;
    for (std::size_t r = 1; r < rivals.size(); ++r) {
      const auto [entry, is_new] = rival.try_emplace(rivals[r], out.robot.rivals.size());
      const auto scan = run.trace->scans.find(rivals[r]);
      if (is_new)
        out.robot.rivals.push_back(
            {rivals[r], scan == run.trace->scans.end() ? 0.0 : scan->second, {}, {}});
      out.rivals.emplace_back(believed->second, entry->second);
    }
  }
}

}  // namespace

PlannedRun read_planned_run(const PlanCommandOptions& options) {
  const StoredRun run = read_stored_run(options.source);
  const Calibration& calibration = run.calibration;
  require_fixed_camera(options.source, calibration);
  require_covariance(options.source, calibration);
  design::MotionLimits limits = recorded_limits(calibration, options.range);
  std::vector<std::string> warnings;
  std::string why_not;
  const std::optional<JointLog> log = recorded_log(options.source, why_not);
  const SeenCorners seen = read_seen_corners(options.source / "residuals.csv", calibration);
  const bool of_postures = log && shows_postures(calibration.tree, *log, seen.times_s);
  if (log && !of_postures) {
    take_recorded_speeds(*log, calibration.tree, options.speed, limits);
    if (const std::string still = still_joints(calibration.tree, limits); !still.empty())
      why_not = still + " stood still in its recording";
  } else if (of_postures) {
    why_not = "its recording is of postures at rest";
  }
  if (options.limits) take_urdf_limits(*options.limits, calibration, limits, warnings);
  if (!options.limits)
    warnings.push_back(
        "the joints' limits are not declared: what the run recorded of each joint is its range "
        "(--limits robot.urdf, --range)");
  if (calibration.cameras() > 1 && !calibration.of_recordings())
    warnings.push_back("the plan is for the camera " + calibration.camera_name + " alone");
  PlannedRun out{{}, {calibration.tree, limits}, {}, {}, 0.0, false, false, {}, {}};
  out.robot.calibration = calibration;
  out.robot.noise = seen.noise;
  out.robot.sight = seen_limits(options.source / "tracks.csv", calibration);
  take_known_effects(run, out);
  out.unit_factors = run.effects.unit_factors;
  out.frame_rate_hz = options.rate_hz.value_or(rate_of(seen.times_s));
  out.of_postures = of_postures;
  out.speeds_known = why_not.empty();
  out.speeds_unknown = why_not;
  out.warnings = std::move(warnings);
  return out;
}

}  // namespace kinescope
