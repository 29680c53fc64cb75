// SPDX-License-Identifier: Apache-2.0
#include "app/torque/torque_trace_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "app/io/json_text.h"
#include "app/report/result_values.h"
#include "app/report/trace_json.h"
#include "dynamics/data/splits.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"
#include "kinematics/urdf/dynamic_urdf.h"

namespace kinescope {
namespace {

// t, trajectory, then q, dq, ddq and the compensated torque of every joint.
std::string compensated_csv(const TorqueSamples& samples, const std::vector<std::string>& joints) {
  std::string out = "t,trajectory";
  for (const char* what : {"q", "dq", "ddq", "tau"}) {
    for (const std::string& joint : joints) out += fmt::format(",{}_{}", what, joint);
  }
  out += "\n";
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    out += fmt::format("{},{}", samples.t_s[i], samples.trajectory[i]);
    for (const Eigen::MatrixXd* values : {&samples.q, &samples.dq, &samples.ddq, &samples.torque}) {
      for (Eigen::Index j = 0; j < values->cols(); ++j) {
        out += fmt::format(",{:.9g}", (*values)(i, j));
      }
    }
    out += "\n";
  }
  return out;
}

nlohmann::json corrected_json(const CorrectedTorqueModel& corrected) {
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t k = 0; k < corrected.effects.size(); ++k) {
    const TorqueEffect& effect = corrected.effects[k];
    nlohmann::json parameters = nlohmann::json::array();
    for (std::size_t p = 0; p < effect.parameters.size(); ++p) {
      parameters.push_back({{"name", effect.parameters[p].name},
                            {"unit", effect.parameters[p].unit},
                            {"value", effect.values[static_cast<Eigen::Index>(p)]}});
    }
    list.push_back({{"effect", effect.id.effect},
                    {"place", effect.id.place},
                    {"at", effect.scan},
                    {"in_urdf", corrected.in_model[k] != 0},
                    {"parameters", std::move(parameters)}});
  }
  return list;
}

nlohmann::json motion_json(const CorrectedTorqueModel& corrected) {
  nlohmann::json joints = nlohmann::json::array();
  for (std::size_t j = 0; j < corrected.travels.size(); ++j) {
    joints.push_back({{"name", report::text(corrected.base.rigid.bodies[j].joint)},
                      {"high_speed", corrected.travels[j].high_speed}});
  }
  return {{"begin_s", corrected.log.begin_s},
          {"duration_s", corrected.log.duration_s},
          {"joints", std::move(joints)}};
}

nlohmann::json contacts_json(const std::vector<ContactSpan>& contacts,
                             const TorqueSamples& samples) {
  nlohmann::json list = nlohmann::json::array();
  for (const ContactSpan& span : contacts) {
    list.push_back({{"trajectory", report::text(samples.trajectory_name(span.from.trajectory))},
                    {"from_s", span.from.t_s},
                    {"to_s", span.to.t_s}});
  }
  return list;
}

SavedTrace saved_trace(const TorqueTrace& trace, const TorqueSamples& samples,
                       const TorqueFilter& filter) {
  const Eigen::MatrixXd all = samples.torque - predict_torque(trace.corrected, samples, filter);
  const Eigen::MatrixXd left = all(measured_rows(samples), Eigen::all);
  return {trace.corrected, filter,
          left.colwise().norm().transpose() / std::sqrt(static_cast<double>(left.rows()))};
}

/// The robot as a URDF; nothing where it cannot be read again, which is said in the model's notes.
std::optional<std::string> readable_urdf(CorrectedTorqueModel& corrected) {
  try {
    std::string text = write_urdf(corrected.model);
    (void)parse_dynamic_urdf(text, "robot_traced.urdf");
    return text;
  } catch (const Error& error) {
    corrected.notes.push_back(fmt::format("is not written: {}", error.what()));
    corrected.in_model.assign(corrected.effects.size(), 0);
    return std::nullopt;
  }
}

void remove_corrected(const OutputFolder& folder) {
  for (const char* name : {"robot_traced.urdf", "torque_compensated.csv"}) folder.remove(name);
}

struct DriveTerm {
  std::string_view effect;
  std::string_view term;
  double JointDynamics::* declared;  // none: the URDF knows no such thing
};
constexpr std::array<DriveTerm, 4> kDriveTerms{
    {{"viscous", "viscous", &JointDynamics::viscous},
     {"coulomb", "coulomb", &JointDynamics::coulomb},
     {"motor_inertia", "motor inertia", &JointDynamics::motor_inertia},
     {"torque_offset", "offset", nullptr}}};
constexpr std::array<std::string_view, 6> kFrictionCurves{
    "asymmetric", "stribeck", "cubic_viscous", "load_friction", "position_friction", "hysteresis"};
constexpr double kSigmas = 1.96;  // of half a 95 % interval

double declared_value(const DynamicModel& model, const DriveTerm& term, const std::string& joint) {
  if (term.declared == nullptr) return 0.0;
  for (std::size_t j = 0; j < model.tree.joints.size(); ++j) {
    if (model.tree.joints[j].name == joint) return model.joints[j].*term.declared;
  }
  return 0.0;
}

void drop_friction_not_found(const Trace& trace, std::vector<DriveEstimate>& drives) {
  std::erase_if(drives, [&](const DriveEstimate& drive) {
    if (drive.term != "viscous" && drive.term != "coulomb") return false;
    const auto at_joint = [&](const auto& wanted) {
      return std::ranges::any_of(trace.accepted, [&](const TracedEffect& effect) {
        return effect.id.place == drive.joint && wanted(effect.id.effect);
      });
    };
    return !at_joint([&](const std::string& name) { return name == drive.term; }) &&
           at_joint([&](const std::string& name) {
             return std::ranges::find(kFrictionCurves, name) != kFrictionCurves.end();
           });
  });
}

}  // namespace

void take_traced_drives(const TorqueTrace& trace, const DynamicModel& declared,
                        std::vector<DriveEstimate>& drives) {
  const bool of_urdf = trace.base.kind == TorqueBaseKind::kDeclared;
  if (!of_urdf) drop_friction_not_found(trace.trace, drives);
  for (const TracedEffect& effect : trace.trace.accepted) {
    const auto term = std::ranges::find(kDriveTerms, effect.id.effect, &DriveTerm::effect);
    if (term == kDriveTerms.end()) continue;
    const auto own = std::ranges::find_if(drives, [&](const DriveEstimate& drive) {
      return drive.term == term->term && drive.joint == effect.id.place;
    });
    DriveEstimate& drive = own != drives.end()
                               ? *own
                               : drives.emplace_back(DriveEstimate{std::string(term->term),
                                                                   effect.id.place, 0.0, 0.0});
    drive.value = effect.size + (of_urdf ? declared_value(declared, *term, drive.joint) : 0.0);
    drive.sigma = 0.5 * (effect.interval.high - effect.interval.low) / kSigmas;
  }
  std::ranges::stable_sort(drives, {}, &DriveEstimate::joint);
}

void remove_torque_trace(const std::string& trace_file, const OutputFolder& folder) {
  remove_corrected(folder);
  folder.remove(trace_file);
}

TracedLog trace_torque_stage(const DynamicsOptions& options, const DynamicModel& model,
                             const TorqueLogReport& log, const CutoffChoice& cutoff,
                             const OutputFolder& folder, const Progress& progress) {
  MotionOptions motion = options.data.motion;
  if (motion.cutoff_hz <= 0.0) motion.cutoff_hz = tracing_cutoff_hz(cutoff);
  const TorqueData traced = filtered_data(log, motion);
  TorqueTraceOptions trace_options;
  trace_options.model.filter = {traced.filter, traced.cutoff.cutoff_hz};
  TorqueTrace out = trace_torque(model, traced.samples, trace_options, progress);

  const bool found = out.trace.verdict != TraceVerdict::kNothingToSay;
  const std::optional<std::string> urdf = found ? readable_urdf(out.corrected) : std::nullopt;
  nlohmann::json document = trace_json(out.trace);
  document["base"] = {{"masses", to_string(out.base.kind)}, {"reason", out.base.reason}};
  document["effects"] = corrected_json(out.corrected);
  document["motion"] = motion_json(out.corrected);
  document["left_out"] = contacts_json(out.contacts, traced.samples);
  folder.write(options.trace_file, json_text(document));
  if (!urdf) folder.remove("robot_traced.urdf");
  if (!found) {
    remove_corrected(folder);
    return {std::move(out), {}, traced.samples, trace_options, false};
  }
  if (urdf) folder.write("robot_traced.urdf", *urdf);
  std::vector<std::string> joints;
  for (const WantedJoint& joint : wanted_joints(model.tree)) joints.push_back(joint.name);
  folder.write("torque_compensated.csv",
               compensated_csv(measured_part(compensate(out.corrected, traced.samples,
                                                        trace_options.model.filter)),
                               joints));
  SavedTrace saved = saved_trace(out, traced.samples, trace_options.model.filter);
  return {std::move(out), std::move(saved), traced.samples, trace_options, urdf.has_value()};
}

}  // namespace kinescope
