// SPDX-License-Identifier: Apache-2.0
#include "app/commands/simulated_robot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/output_folder.h"
#include "app/io/same_place.h"
#include "app/io/torque_effects_file.h"
#include "dynamics/data/column_names.h"
#include "dynamics/data/log_checks.h"
#include "dynamics/simulation/plant.h"
#include "dynamics/simulation/robot_effects.h"
#include "kinematics/core/error.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/log/smoothing_spline.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

/// The channel of every joint: its name, q_NAME or NAME_position; where none is named so, and there
/// are as many as joints, their order.
std::vector<int> channels_of(const JointLog& log, const TorqueRobot& robot) {
  std::vector<int> out;
  std::string missing;
  for (const std::string& joint : robot.joints) {
    std::optional<int> found;
    for (const std::string& name : {joint, "q_" + joint, joint + "_position"}) {
      if (!found) found = log.channel(name);
    }
    if (found) {
      out.push_back(*found);
    } else if (missing.empty()) {
      missing = joint;
    }
  }
  if (missing.empty()) return out;
  if (out.empty() && log.channels.size() == robot.joints.size()) {
    for (std::size_t j = 0; j < robot.joints.size(); ++j) out.push_back(static_cast<int>(j));
    return out;
  }
  throw bad_input(log.source, fmt::format("has no column for joint '{}'", missing),
                  fmt::format("name the columns t, {}", fmt::join(robot.joints, ", ")));
}

bool is_joint_position(const std::string& column) {
  const auto meaning = read_column_name(column);
  return !meaning || (meaning->quantity == LoggedQuantity::kPosition &&
                      meaning->origin == LoggedOrigin::kPlain);
}

/// What another robot's trajectory shows by: columns of no joint of this one, or of other names.
std::vector<std::string> assignment_words(const JointLog& log, const std::vector<int>& channels,
                                          const TorqueRobot& robot) {
  std::vector<std::string> in_order;
  std::vector<std::string> others;
  for (std::size_t c = 0; c < log.channels.size(); ++c) {
    const auto used = std::ranges::find(channels, static_cast<int>(c));
    if (used == channels.end()) {
      if (is_joint_position(log.channels[c]))
        others.push_back(fmt::format("'{}'", log.channels[c]));
      continue;
    }
    const std::string& joint = robot.joints[static_cast<std::size_t>(used - channels.begin())];
    if (log.channels[c].find(joint) == std::string::npos)
      in_order.push_back(fmt::format("{} = {}", joint, log.channels[c]));
  }
  std::vector<std::string> out;
  if (!in_order.empty()) {
    out.push_back(fmt::format(
        "{}: no column is named like a joint: taken in their order: {} (check that the log is this "
        "robot's)",
        log.source, fmt::join(in_order, ", ")));
  }
  if (!others.empty()) {
    out.push_back(fmt::format(
        "{}: {} joints are wanted, the log has {}: {} left out (check that the log is this "
        "robot's)",
        log.source, channels.size(), channels.size() + others.size(), fmt::join(others, ", ")));
  }
  return out;
}

/// Values that are too large to be rad or m.
void require_plausible_units(const JointLog& log, const Eigen::MatrixXd& values,
                             const std::vector<int>& channels, const TorqueRobot& robot) {
  TorqueLog checked;
  checked.sources = {log.source};
  checked.q = values;
  checked.source.assign(static_cast<std::size_t>(values.rows()), 0);
  checked.lines.assign(static_cast<std::size_t>(values.rows()), 0);
  for (std::size_t j = 0; j < channels.size(); ++j) {
    checked.joints.push_back({robot.joints[j], robot.types[j] == JointType::kPrismatic});
    checked.q_columns.push_back(log.channels[static_cast<std::size_t>(channels[j])]);
  }
  for (const LogFinding& finding : check_ranges(checked))
    throw bad_input(log.source, finding.what, "write the trajectory in rad and m");
}

/// Viscous and Coulomb friction of the drives, what tracing calls it, what a URDF does.
struct FrictionTerm {
  const char* effect;
  double JointDynamics::* own;
  const char* attribute;
};
constexpr std::array kFrictionTerms = {
    FrictionTerm{"viscous", &JointDynamics::viscous, "damping"},
    FrictionTerm{"coulomb", &JointDynamics::coulomb, "friction"}};

/// A robot and effects to add to it, each of which one of them has.
struct RobotAndEffects {
  DynamicModel robot;
  std::vector<ListedEffect> effects;
  std::vector<std::string> given_way;  ///< of the URDF's friction, to the effects
};

/// Of a trace, effects that the URDF already holds are not added again.
std::vector<ListedEffect> not_yet_in(const fs::path& robot, const fs::path& trace,
                                     const ListedEffects& listed) {
  const auto is_beside = [&](const char* name) {
    return same_place(robot, trace.parent_path() / name);
  };
  // What was traced on declared masses, the masses and the friction identified beside it hold too.
  const bool held = is_beside("robot_traced.urdf") ||
                    (!listed.identified_masses && is_beside("robot_dynamics.urdf"));
  std::vector<ListedEffect> effects = listed.effects;
  std::erase_if(effects, [&](const ListedEffect& effect) { return held && effect.in_urdf; });
  return effects;
}

/// What a trace on declared masses adds to its URDF's friction is an excess; all else is the whole
/// friction of its kind.
RobotAndEffects counted_once(const fs::path& urdf, const fs::path& file,
                             const ListedEffects& listed, DynamicModel robot) {
  RobotAndEffects out{
      .robot = std::move(robot), .effects = not_yet_in(urdf, file, listed), .given_way = {}};
  const bool excess = listed.traced && !listed.identified_masses;
  if (excess || same_place(urdf, file.parent_path() / "robot_traced.urdf")) return out;
  for (const FrictionTerm& term : kFrictionTerms) {
    for (std::size_t j = 0; j < out.robot.tree.joints.size(); ++j) {
      const EffectId id{term.effect, out.robot.tree.joints[j].name};
      const bool added = std::ranges::any_of(
          out.effects, [&](const ListedEffect& entry) { return entry.effect.id == id; });
      double& own = out.robot.joints[j].*term.own;
      if (!added || own == 0.0) continue;
      out.given_way.push_back(fmt::format("{} of {} ({:.4g})", term.attribute, id.place, own));
      own = 0.0;
    }
  }
  return out;
}

}  // namespace

TorqueSamples reference_motion(const fs::path& trajectory, const TorqueRobot& robot, double rate_hz,
                               const Console& console) {
  const JointLog log = recorded::read_joint_log(trajectory);
  for (const std::string& warning : log.warnings) console.warn(warning);
  constexpr std::size_t kFewest = 8;  // of the spline
  if (log.size() < kFewest) {
    throw bad_input(log.source, fmt::format("holds {} rows", log.size()),
                    fmt::format("give at least {}", kFewest));
  }
  const std::vector<int> channels = channels_of(log, robot);
  for (const std::string& words : assignment_words(log, channels, robot)) console.warn(words);
  Eigen::MatrixXd values(std::ssize(log.times_s), std::ssize(channels));
  for (std::size_t j = 0; j < channels.size(); ++j) {
    values.col(static_cast<Eigen::Index>(j)) = log.values.col(channels[j]);
  }
  require_plausible_units(log, values, channels, robot);
  const Eigen::VectorXd t_s =
      Eigen::Map<const Eigen::VectorXd>(log.times_s.data(), std::ssize(log.times_s));
  const double span_s = t_s[t_s.size() - 1] - t_s[0];
  // A million of them took 0.8 GB (two joints, 100 kHz, 10 s).
  constexpr double kMostValues = 4e6;
  const double values_asked = span_s * rate_hz * static_cast<double>(channels.size());
  if (!(values_asked <= kMostValues)) {
    throw bad_input(
        log.source,
        fmt::format("lasts {:.3g} s: {:.3g} joint values at {:.6g} Hz are more than the "
                    "{:.3g} that are simulated",
                    span_s, values_asked, rate_hz, kMostValues),
        "give stamps in seconds, a shorter trajectory, or a lower --rate");
  }
  // Smooth enough to be followed, near enough to pass through the rows: a quarter of their rate.
  constexpr double kOfRate = 0.25;
  const double cutoff_hz = kOfRate * static_cast<double>(t_s.size() - 1) / span_s;
  const SmoothingSpline spline(t_s, values, cutoff_hz);
  TorqueSamples out;
  const auto rows = static_cast<Eigen::Index>(std::floor(span_s * rate_hz)) + 1;
  if (rows < 2) {
    throw bad_input(log.source, fmt::format("lasts {:.3g} s, less than a period", span_s),
                    "give a longer trajectory, or a higher --rate");
  }
  out.t_s = t_s[0] + Eigen::ArrayXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1)) / rate_hz;
  // Rounding must not leave the spline.
  out.t_s = out.t_s.cwiseMin(t_s[t_s.size() - 1]);
  out.q = spline.evaluate(out.t_s);
  out.dq = spline.evaluate(out.t_s, 1);
  out.ddq = spline.evaluate(out.t_s, 2);
  out.torque = Eigen::MatrixXd::Zero(rows, out.q.cols());
  out.trajectory = Eigen::VectorXi::Zero(rows);
  return out;
}

CorrectedTorqueModel simulated_robot(const fs::path& urdf, const DynamicModel& robot,
                                     const std::optional<fs::path>& effects,
                                     const TorqueSamples& motion, const Console& console) {
  if (!effects) return with_effects(robot);
  const ListedEffects listed = read_listed_effects(*effects);
  const RobotEffects known = effects_of_robot(robot, motion);
  std::vector<JointTravel> travels = known.travels;
  const std::vector<JointId> joints = moving_joints(robot.tree);
  for (std::size_t j = 0; j < travels.size(); ++j) {
    const auto speed = listed.high_speeds.find(robot.tree.joints[joints[j].index()].name);
    if (speed != listed.high_speeds.end()) travels[j].high_speed = speed->second;
  }
  RobotAndEffects once = counted_once(urdf, *effects, listed, robot);
  if (!once.given_way.empty()) {
    console.warn(fmt::format(
        "{}: its friction is not counted twice: {} give way to {} (take them out of there to keep "
        "the URDF's)",
        urdf.string(), fmt::join(once.given_way, ", "), effects->string()));
  }
  return with_effects(once.robot, resolved(once.effects, known.candidates), travels,
                      listed.log.value_or(known.log));
}

void require_masses(const fs::path& urdf, const DynamicModel& robot) {
  if (has_masses(robot)) return;
  throw bad_input(urdf.string(), "no link has a mass",
                  "give a robot with masses: robot_dynamics.urdf of kinescope dynamics");
}

std::string torque_log_csv(const TorqueSamples& samples, const std::vector<std::string>& joints) {
  std::string out = "t";
  for (const char* what : {"q", "dq", "tau"}) {
    for (const std::string& joint : joints) out += fmt::format(",{}_{}", what, joint);
  }
  out += "\n";
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    out += fmt::format("{:.9g}", samples.t_s[i]);
    for (const Eigen::MatrixXd* values : {&samples.q, &samples.dq, &samples.torque}) {
      for (Eigen::Index j = 0; j < values->cols(); ++j) {
        out += fmt::format(",{:.10g}", (*values)(i, j));
      }
    }
    out += "\n";
  }
  return out;
}

}  // namespace kinescope
