// SPDX-License-Identifier: Apache-2.0
//
// The calibration file of a LeRobot arm, with ranges that make the driver's values the joint angles
// of the nominal robot.
//
// The driver knows no zero and no scale of a joint, only the range of its counts: 0 degrees (and 0
// %) is in its middle. What a run found of a joint (its zero against the drawing, the scale of its
// channel, effects at its encoder) is put into a line, angle = slope * value + offset, over the
// logged values; the new range is the one whose middle (of degrees) or ends (of per cent: the
// nominal robot's limits) that line puts where the drawing has them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/export_form.h"
#include "app/commands/run_again.h"
#include "app/io/lerobot_file.h"
#include "app/io/output_folder.h"
#include "app/report/result_values.h"
#include "calib/effects/corrected_log.h"
#include "calib/quality/robot_difference.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr double kDegreesPerRad = 180.0 / std::numbers::pi;
// Chosen: servos count their turn to a fraction of a per cent; a joint that is off by more is
// geared, logged in another unit, or of another file.
constexpr double kSameScale = 1.1;

// Where the nominal robot's joint is at a reading of zero, and how well the run shows it. Of a run
// that holds the drawing's zeros, which predict best then, no sigma.
struct ShownZero {
  bool shown = false;
  double angle_rad = 0.0;
  Sigma sigma_rad;
};

// One joint over the log: what the driver said, and where the nominal robot's joint was.
struct LoggedJoint {
  std::string joint, channel;
  std::vector<double> value;      // in the driver's unit
  std::vector<double> angle_deg;  // of the nominal robot's joint
  std::optional<JointLimits> limits;
  ShownZero zero;
  double degrees_per_unit = 0.0;  // signed
};

// The same joints where the drawing has them.
KinematicTree as_drawn(KinematicTree tree, const KinematicTree& nominal) {
  for (Joint& joint : tree.joints) {
    const auto drawn = nominal.joint(joint.name);
    if (!drawn) continue;
    joint.T_parent_joint = nominal.joints[drawn->index()].T_parent_joint;
    joint.axis = nominal.joints[drawn->index()].axis;
  }
  return tree;
}

// Beside the joints. A zero is the angle between the axes before the joint and behind it, as frames
// are a choice; of the first joint and the last it is hidden by where the base and the markers sit.
std::vector<ShownZero> shown_zeros(Calibration run, const KinematicTree& nominal) {
  std::vector<ShownZero> out(run.tree.joints.size());
  bool any = false;
  for (std::size_t j = 0; j < run.joints.size(); ++j) {
    const JointLimits& range = run.joints[j].range;
    const bool moved = range.lower < range.upper && nominal.joint(run.tree.joints[j].name);
    if (!moved) run.tree.joints[j].type = JointType::kFixed;
    any = any || moved;
  }
  if (!any) return out;
  const RobotMatch match = match_robots(run.tree, run.tree);
  const RobotLayout layout = robot_layout({&run, 1}, {&match, 1});
  const RobotNumbers numbers = robot_numbers(layout, run, match);
  const auto values_in = [&](const KinematicTree& tree) {
    std::vector<JointId> joints;
    return axis_values(layout.axes,
                       placed_axes(tree, Eigen::VectorXd::Zero(std::ssize(tree.joints)), joints));
  };
  const Eigen::VectorXd turned = values_in(run.tree) - values_in(as_drawn(run.tree, nominal));
  for (std::size_t i = 0; i < layout.axes.quantities.size(); ++i) {
    const AxisQuantity& quantity = layout.axes.quantities[i];
    const bool held = numbers.states[i] == NumberState::kHeld;
    if (quantity.kind != AxisQuantityKind::kAngle) continue;
    if (!held && numbers.states[i] != NumberState::kEstimated) continue;
    const auto at = static_cast<Eigen::Index>(i);
    const auto axis = static_cast<std::size_t>(quantity.axis);
    ShownZero& zero = out[static_cast<std::size_t>(layout.joints[axis])];
    const double sigma = std::sqrt(numbers.covariance(at, at));
    // Of several axes behind it the one that shows it best.
    if (zero.shown && (held || !zero.sigma_rad || sigma >= *zero.sigma_rad)) continue;
    zero = {true, std::remainder(turned[at], 2.0 * std::numbers::pi),
            held ? Sigma() : Sigma(sigma)};
  }
  return out;
}

// angle = slope * value + offset by least squares; with a slope that is given, the offset alone.
struct Line {
  double slope = 0.0, offset = 0.0;
  double farthest = 0.0;  // what it misses an angle by, at most
};

Line line_through(const LoggedJoint& joint, std::optional<double> slope) {
  const auto n = static_cast<double>(joint.value.size());
  double mean_v = 0.0, mean_a = 0.0, vv = 0.0, va = 0.0;
  for (std::size_t i = 0; i < joint.value.size(); ++i) {
    mean_v += joint.value[i] / n;
    mean_a += joint.angle_deg[i] / n;
  }
  for (std::size_t i = 0; i < joint.value.size(); ++i) {
    vv += (joint.value[i] - mean_v) * (joint.value[i] - mean_v);
    va += (joint.value[i] - mean_v) * (joint.angle_deg[i] - mean_a);
  }
  Line out;
  out.slope = slope.value_or(va / vv);
  out.offset = mean_a - out.slope * mean_v;
  for (std::size_t i = 0; i < joint.value.size(); ++i)
    out.farthest = std::max(out.farthest,
                            std::abs(joint.angle_deg[i] - out.slope * joint.value[i] - out.offset));
  return out;
}

// Joints that turn, are driven by one channel that is logged, and are drawn.
std::vector<LoggedJoint> logged_joints(const StoredRun& run, const Recording& recording) {
  const KinematicTree& tree = run.calibration.tree;
  const JointLog& log = recording.log;
  const CorrectedLog corrected =
      corrected_log(log, tree, run.effects.effects, run.effects.gravity_base);
  const std::vector<ShownZero> zeros = shown_zeros(run.calibration, *recording.nominal);
  std::vector<LoggedJoint> out;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const auto channel = log.channel(joint.channel);
    const auto drawn = recording.nominal->joint(joint.name);
    if (joint.type != JointType::kRevolute || !joint.couplings.empty() || !channel || !drawn)
      continue;
    const Joint& nominal = recording.nominal->joints[drawn->index()];
    const auto factor = log.unit_factors.find(joint.channel);
    LoggedJoint one{joint.name, joint.channel, {}, {}, nominal.limits, zeros[j], 0.0};
    for (Eigen::Index i = 0; i < log.values.rows(); ++i) {
      const double said = log.values(i, *channel);
      const double angle =
          zeros[j].angle_rad + joint.scale * corrected.log.values(i, *channel) + joint.offset;
      if (!std::isfinite(said) || !std::isfinite(angle)) continue;
      one.value.push_back(factor == log.unit_factors.end() ? said : said / factor->second);
      one.angle_deg.push_back(kDegreesPerRad * angle);
    }
    if (one.value.size() < 2 || std::ranges::min(one.value) == std::ranges::max(one.value))
      continue;
    one.degrees_per_unit = line_through(one, std::nullopt).slope;
    if (std::isfinite(one.degrees_per_unit) && one.degrees_per_unit != 0.0)
      out.push_back(std::move(one));
  }
  return out;
}

// A column may be named as in LeRobot's features: "shoulder_pan.pos".
const LerobotMotor* motor_for(const LerobotCalibration& arm, const std::string& channel) {
  constexpr std::string_view kPosition = ".pos";
  const bool ends = channel.ends_with(kPosition);
  return arm.motor(ends ? channel.substr(0, channel.size() - kPosition.size()) : channel);
}

double scale_off(const LoggedJoint& joint, const LerobotMotor& motor, LerobotValues values) {
  return std::abs(std::log(std::abs(joint.degrees_per_unit) / degrees_per_unit(motor, values)));
}

// Degrees or per cent: all joints of an arm are logged alike, but for a gripper (0 to 100).
LerobotValues values_of(const std::vector<std::pair<LoggedJoint, LerobotMotor>>& joints,
                        const fs::path& file) {
  // Chosen: of servos that count their turn to a fraction of a per cent.
  constexpr double kAlike = 0.01;
  const double most = std::log(kSameScale);
  // Mean over the joints; one that fits neither says nothing.
  const auto misfit = [&](LerobotValues values) {
    double sum = 0.0;
    for (const auto& [joint, motor] : joints)
      sum += std::min(scale_off(joint, motor, values), most);
    return sum / static_cast<double>(joints.size());
  };
  const double degrees = misfit(LerobotValues::kDegrees), percent = misfit(LerobotValues::kPercent);
  const bool fits = std::min(degrees, percent) < most;
  if (fits && std::abs(degrees - percent) < kAlike)
    throw undetermined(
        file.string(),
        "its ranges are such that a degree is a per cent: the log's unit is not seen",
        "say it with --lerobot-values degrees or percent");
  if (fits) return degrees < percent ? LerobotValues::kDegrees : LerobotValues::kPercent;
  const auto& [joint, motor] = joints.front();
  throw bad_input(file.string(),
                  fmt::format("joint {} turns by {:.4g} degrees for one unit of the log, motor {} "
                              "by 1 in degrees or {:.4g} in per cent",
                              joint.joint, std::abs(joint.degrees_per_unit), motor.name,
                              degrees_per_unit(motor, LerobotValues::kPercent)),
                  "give the calibration file that the arm had when the log was recorded");
}

struct NewRange {
  int range_min = 0, range_max = 0;
};

// Symmetrical about the count of 0 degrees, within the old range: the stops are where they were.
std::optional<NewRange> range_of_degrees(const LerobotMotor& motor, double zero_count) {
  const auto sum = std::llround(2.0 * zero_count);
  const long long low = std::max<long long>(motor.range_min, sum - motor.range_max);
  const long long high = sum - low;
  if (low >= high) return std::nullopt;
  return NewRange{static_cast<int>(low), static_cast<int>(high)};
}

std::optional<NewRange> range_of_limits(double count, double other) {
  const double low = std::round(std::min(count, other)), high = std::round(std::max(count, other));
  if (!(low >= 0.0 && high < kCountsPerTurn && low < high)) return std::nullopt;
  return NewRange{static_cast<int>(low), static_cast<int>(high)};
}

// What became of one motor.
struct MotorChange {
  std::string joint, motor;
  LerobotValues values = LerobotValues::kDegrees;
  double angle_at_zero_deg = 0.0;  // where the old file's value 0 is
  double left_deg = 0.0;           // what no range can hold, over the logged values
  Sigma zero_sigma_rad;
  LerobotMotor before;
  NewRange after;
  bool reversed = false;
};

// Nothing, and why, where the file cannot hold it.
std::optional<MotorChange> change_of(const LoggedJoint& joint, const LerobotMotor& motor,
                                     LerobotValues values, std::string& why_not) {
  if (scale_off(joint, motor, values) > std::log(kSameScale)) {
    values = LerobotValues::kHundred;  // a gripper's
    if (scale_off(joint, motor, values) > std::log(kSameScale)) {
      why_not = fmt::format("it turns by {:.4g} degrees for one unit of the log",
                            std::abs(joint.degrees_per_unit));
      return std::nullopt;
    }
  }
  if (!joint.zero.shown) {
    why_not =
        "its zero is not seen: it is the first or last joint that moved, and the base, or the "
        "markers behind it, may sit turned";
    return std::nullopt;
  }
  const bool degrees = values == LerobotValues::kDegrees;
  if (!degrees && motor.drive_mode != 0) {
    why_not = "its drive_mode is 1, which drivers take differently";
    return std::nullopt;
  }
  MotorChange out{joint.joint,          motor.name, values, 0.0,  0.0,
                  joint.zero.sigma_rad, motor,      {},     false};
  out.reversed = joint.degrees_per_unit < 0.0;
  const double sign = out.reversed ? -1.0 : 1.0;
  const Line line = line_through(joint, degrees ? std::optional(sign) : std::nullopt);
  out.angle_at_zero_deg = line.offset;
  out.left_deg = line.farthest;
  const auto count_of_angle = [&](double angle_deg) {
    return count_at(motor, values, (angle_deg - line.offset) / line.slope);
  };
  std::optional<NewRange> range;
  if (degrees) {
    range = range_of_degrees(motor, count_of_angle(0.0));
    why_not = "its zero is outside the range of its counts";
  } else if (joint.limits) {
    range = range_of_limits(count_of_angle(kDegreesPerRad * joint.limits->lower),
                            count_of_angle(kDegreesPerRad * joint.limits->upper));
    why_not = "the nominal robot's limits are beyond the turn that its counts cover";
  } else {
    why_not = "the nominal robot gives it no limits";
  }
  if (!range) return std::nullopt;
  out.after = *range;
  return out;
}

double turn_deg(double counts) { return counts * 360.0 / kCountsPerTurn; }

std::string words_of(const MotorChange& change) {
  const std::string about =
      change.zero_sigma_rad
          ? fmt::format(" (U = {:.2g})", 2.0 * kDegreesPerRad * *change.zero_sigma_rad)
          : "";
  return fmt::format(
      "{}: at the old file's 0 it stood at {:.2f} deg{}; range {} .. {} becomes {} .. {}; up to "
      "{:.2f} deg over the log are left{}",
      change.motor, change.angle_at_zero_deg, about, change.before.range_min,
      change.before.range_max, change.after.range_min, change.after.range_max, change.left_deg,
      change.reversed ? "; it counts the other way than the nominal robot" : "");
}

void warn_of_range(const MotorChange& change, std::vector<std::string>& warnings) {
  const int below = change.before.range_min - change.after.range_min;
  const int above = change.after.range_max - change.before.range_max;
  const int beyond = std::max(below, above), lost = std::max(-below, -above);
  // A count or two is no travel.
  constexpr double kSomeTravelDeg = 1.0;
  if (change.values != LerobotValues::kDegrees && turn_deg(beyond) > kSomeTravelDeg)
    warnings.push_back(
        fmt::format("{}: the nominal robot's limits are up to {:.1f} deg beyond the range that the "
                    "arm was moved over: -100 and 100 may be behind a stop",
                    change.motor, turn_deg(beyond)));
  if (change.values == LerobotValues::kDegrees && turn_deg(lost) > kSomeTravelDeg)
    warnings.push_back(
        fmt::format("{}: {:.1f} deg of travel are lost at one end, since the driver's zero is the "
                    "middle of the range",
                    change.motor, turn_deg(lost)));
}

nlohmann::json change_json(const MotorChange& change) {
  return {{"joint", report::text(change.joint)},
          {"motor", report::text(change.motor)},
          {"values", to_string(change.values)},
          {"angle_at_zero_deg", report::number(change.angle_at_zero_deg)},
          {"U_zero_deg", change.zero_sigma_rad
                             ? report::number(2.0 * kDegreesPerRad * *change.zero_sigma_rad)
                             : nlohmann::json(nullptr)},
          {"left_deg", report::number(change.left_deg)},
          {"range_before", {change.before.range_min, change.before.range_max}},
          {"range", {change.after.range_min, change.after.range_max}},
          {"reversed", change.reversed}};
}

Recording recording_of(const fs::path& folder) {
  const RunOptions again = options_of_run(folder);
  if (!again.further.empty())
    throw bad_input(folder.string(), "is of several recordings, which may be of several files",
                    "run the one with the arm's last calibration alone");
  Recording out = read_recording(again.recording);
  require_same_inputs(folder, out);
  if (!out.nominal)
    throw bad_input(folder.string(), "was run without a nominal robot: no zero is wrong or right",
                    "run the recording with --nominal robot.urdf");
  if (out.log.empty())
    throw bad_input(folder.string(), "was run without a joint log", "log the joints");
  return out;
}

}  // namespace

ExportForm export_lerobot(const ExportOptions& options) {
  std::error_code error;
  if (!fs::is_directory(options.source, error))
    throw bad_request("--lerobot", fmt::format("{} is no folder of a run", options.source.string()),
                      "give the folder of a finished kinescope run");
  LerobotCalibration arm = read_lerobot_calibration(options.lerobot_from);
  const StoredRun run = read_stored_run(options.source);
  require_new_file(options.lerobot, "--lerobot",
                   {options.lerobot_from, options.source / "calibration.json"}, options.force);
  const Recording recording = recording_of(options.source);
  std::vector<std::pair<LoggedJoint, LerobotMotor>> joints;
  for (LoggedJoint& joint : logged_joints(run, recording))
    if (const LerobotMotor* motor = motor_for(arm, joint.channel))
      joints.emplace_back(std::move(joint), *motor);
  if (joints.empty()) {
    std::vector<std::string> names;
    for (const LerobotMotor& motor : arm.motors) names.push_back(motor.name);
    throw bad_input(options.lerobot_from.string(),
                    fmt::format("no calibrated joint is driven by one of its motors: {}",
                                fmt::join(names, ", ")),
                    "the channels of the log are to be named as the motors");
  }
  const LerobotValues values =
      options.lerobot_values ? *options.lerobot_values : values_of(joints, options.lerobot_from);
  ExportForm out;
  nlohmann::json changes = nlohmann::json::array();
  for (const auto& [joint, motor] : joints) {
    std::string why_not;
    const auto change = change_of(joint, motor, values, why_not);
    if (!change) {
      out.warnings.push_back(fmt::format("{} stays as it was: {}", motor.name, why_not));
      continue;
    }
    arm.set_range(change->motor, change->after.range_min, change->after.range_max);
    warn_of_range(*change, out.warnings);
    out.lines.push_back(words_of(*change));
    changes.push_back(change_json(*change));
  }
  if (changes.empty()) {
    const bool none_shown =
        std::ranges::none_of(joints, [](const auto& joint) { return joint.first.zero.shown; });
    if (none_shown)
      throw undetermined(options.source.string(),
                         "shows the zero of no joint: each is the first or last that moved",
                         "move the joints before and behind it, with markers on their links");
    throw bad_input(options.lerobot_from.string(), out.warnings.front(),
                    "give the calibration file that the arm had when the log was recorded");
  }
  out.files.push_back({options.lerobot, arm.text()});
  out.result["lerobot"] = {{"file", report::text(options.lerobot.string())},
                           {"values", to_string(values)},
                           {"motors", changes}};
  out.lines.push_back(fmt::format("lerobot {} ({} of {} motors, values in {})",
                                  options.lerobot.string(), changes.size(), arm.motors.size(),
                                  to_string(values)));
  return out;
}

}  // namespace kinescope
