// SPDX-License-Identifier: Apache-2.0
#include "app/torque/model_torque.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/json_text.h"
#include "app/io/nearest_name.h"
#include "app/io/output_folder.h"
#include "app/io/same_place.h"
#include "app/io/torque_model_file.h"
#include "app/report/stopwatch.h"
#include "app/torque/torque_inputs.h"
#include "app/torque/torque_plausibility.h"
#include "app/torque/torque_robust_stage.h"
#include "app/torque/torque_signs.h"
#include "app/torque/torque_split.h"
#include "app/torque/torque_trace_stage.h"
#include "app/torque/traced_score.h"
#include "dynamics/data/splits.h"
#include "dynamics/identify/gravity_from_torques.h"
#include "dynamics/identify/torque_terms.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/recorded/recorded_log.h"
#include "kinematics/urdf/dynamic_urdf.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// What is fitted, and how.
struct Wanted {
  std::vector<TorqueModelKind> kinds;
  TorqueModelOptions options;
  bool robust = false;
};

constexpr const char* kAllModels = "all";

Wanted wanted_models(const DynamicsOptions& options) {
  Wanted out{{}, options.models_options, options.robust.value_or(false)};
  if (options.models.empty()) {
    out.kinds = usual_torque_models();
    out.options = quick_options(out.options);
    return out;
  }
  for (const std::string& name : options.models) {
    if (name == kAllModels) {
      out.kinds = all_torque_models();
      out.robust = options.robust.value_or(true);
      return out;
    }
    const auto kind = torque_model_kind(name);
    if (!kind) {
      std::vector<std::string> known{kAllModels};
      for (const TorqueModelKind k : all_torque_models()) known.emplace_back(to_string(k));
      throw bad_request("--model", fmt::format("'{}' is no torque model", name),
                        did_you_mean(name, known));
    }
    out.kinds.push_back(*kind);
  }
  return out;
}

// Zero of joints that hold still, whose speeds are noise.
Eigen::MatrixXd moving_speeds(const TorqueSamples& samples) {
  constexpr double kStill = 1e-3;  // rad or m
  Eigen::MatrixXd out = samples.dq;
  for (Eigen::Index j = 0; j < out.cols(); ++j) {
    const Eigen::ArrayXd q = samples.q.col(j);
    if (std::sqrt((q - q.mean()).square().mean()) < kStill) out.col(j).setZero();
  }
  return out;
}

// The scale of the torque against the nominal masses, where there are any, and its signs.
TorqueScales check_scale(const std::vector<fs::path>& logs, const DynamicModel& model,
                         const IdentifyOptions& identify, TorqueSummary& summary) {
  if (summary.data.samples.torque_unit == "A") return {};
  TorqueScales scales;
  const TorqueSamples samples = measured_part(summary.data.samples);
  if (has_masses(model)) scales = torque_scales(make_rigid_model(model), samples, logs);
  check_torque_signs(model, samples, identify, logs, scales);
  throw_refusals(scales.findings);
  summary.data.findings.insert(summary.data.findings.end(), scales.findings.begin(),
                               scales.findings.end());
  return scales;
}

std::string_view drive_term(TermKind kind) {
  switch (kind) {
    case TermKind::kViscous:
      return "viscous";
    case TermKind::kCoulomb:
      return "coulomb";
    case TermKind::kOffset:
      return "offset";
    case TermKind::kMotorInertia:
      return "motor inertia";
    default:
      return "";
  }
}

// The drive terms that stand alone among the base parameters.
std::vector<DriveEstimate> drives_of(const TorqueSummary& summary) {
  std::vector<DriveEstimate> out;
  const Identification& found = summary.identification;
  for (std::size_t k = 0; k < found.basis.kept.size(); ++k) {
    const TorqueTerm& term = found.terms[static_cast<std::size_t>(found.basis.kept[k])];
    const std::string_view name = drive_term(term.kind);
    if (name.empty()) continue;
    const auto i = static_cast<Eigen::Index>(k);
    out.push_back({std::string(name), summary.joints[static_cast<std::size_t>(term.index)],
                   found.parameters[i], found.sigma_of(i)});
  }
  std::ranges::stable_sort(out, {}, &DriveEstimate::joint);
  return out;
}

// Friction takes energy. One that is clearly negative is a torque of the other sign, or late.
void warn_of_driving_friction(TorqueSummary& summary) {
  constexpr double kClear = 2.7;  // sigmas: 5 % for seven joints together, Student's t of 20 blocks
  for (const DriveEstimate& drive : summary.drives) {
    if (drive.term != "coulomb" || !(drive.value < -kClear * drive.sigma)) continue;
    std::vector<int> factors(summary.joints.size(), 1);
    const auto at = std::ranges::find(summary.joints, drive.joint) - summary.joints.begin();
    factors[static_cast<std::size_t>(at)] = -1;
    summary.warnings.push_back(fmt::format(
        "friction of {} seems to drive it ({:.3g} +- {:.2g} {}): its torque has the other sign "
        "(dynamics: {{torque_factor: [{}]}} in recording.yaml, or --torque-factor), or comes late",
        drive.joint, drive.value, drive.sigma, summary.train.torque_unit,
        fmt::join(factors, ", ")));
  }
}

void add_learning_curves(const std::vector<TorqueModelKind>& kinds, const DynamicModel& model,
                         const TorqueModelOptions& options, TorqueSummary& summary) {
  for (const TorqueModelKind kind : kinds) {
    if (kind == TorqueModelKind::kLip) continue;  // its sizes are other ones
    std::vector<int> sizes;
    for (int size = 100;
         size <= std::min<int>(options.samples, static_cast<int>(summary.train.size()));
         size *= 2) {
      sizes.push_back(size);
    }
    try {
      summary.learning.push_back(
          {kind, learning_curve(kind, model, summary.train, summary.test, sizes, options)});
    } catch (const Error& error) {
      summary.warnings.push_back(
          fmt::format("no learning curve of {}: {}", to_string(kind), error.what()));
    }
  }
}

// Every model on the held-out samples, the traced one last; the best one's prediction is kept.
std::vector<FittedTorqueModel> compare(const std::vector<TorqueModelKind>& kinds,
                                       const DynamicModel& model, const TorqueModelOptions& options,
                                       const FittedTorqueModel& parametric,
                                       const std::optional<TracedScore>& traced,
                                       const Progress& progress, TorqueSummary& summary) {
  std::vector<FittedTorqueModel> fitted(kinds.size());
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    // A line for each: some take minutes.
    report_progress(progress, fmt::format("{} model", to_string(kinds[k])), 0, 0);
    TorqueScore score;
    score.kind = kinds[k];
    try {
      fitted[k] = kinds[k] == TorqueModelKind::kParametric
                      ? parametric
                      : fit_torque_model(kinds[k], model, summary.train, options, progress);
      score = score_torque_model(fitted[k], summary.test);
    } catch (const Error& error) {
      score.failure = error.what();
    }
    summary.scores.push_back(std::move(score));
  }
  if (traced) summary.scores.push_back(traced->score);
  summary.best = best_score(summary.scores);
  if (summary.best == std::ssize(fitted)) {
    summary.bands = traced->bands;
    summary.prediction = traced->prediction;
    return fitted;
  }
  const FittedTorqueModel& best = fitted[static_cast<std::size_t>(summary.best)];
  summary.bands = best.bands;
  if (best.predict) {
    summary.prediction = best.predict(summary.test.q, summary.test.dq, summary.test.ddq);
  }
  return fitted;
}

std::vector<fs::path> files_read(const DynamicsOptions& options) {
  std::vector<fs::path> out{options.robot};
  for (const auto* logs : {&options.logs, &options.test_logs, &options.unloaded_logs}) {
    out.insert(out.end(), logs->begin(), logs->end());
  }
  return out;
}

Writer writer_of(const DynamicsOptions& options) {
  return {.command = options.owner,
          .products = dynamics_products(options.trace ? options.trace_file : std::string()),
          .inputs = files_read(options),
          .force = options.force};
}

constexpr std::array kSavable = {TorqueModelKind::kParametric, TorqueModelKind::kRbf,
                                 TorqueModelKind::kGip, TorqueModelKind::kSemiParametric};

void check_savable(const DynamicsOptions& options, const std::vector<TorqueModelKind>& kinds) {
  if (options.save_model.empty()) return;
  const auto savable = [](TorqueModelKind kind) {
    return std::ranges::find(kSavable, kind) != kSavable.end();
  };
  if (!std::ranges::any_of(kinds, savable)) {
    throw bad_request("--save-model", fmt::format("{} cannot be saved", to_string(kinds.front())),
                      "name parametric, rbf, gip or semi_parametric");
  }
  require_new_file(options.save_model, "--save-model", files_read(options), options.force);
  for (const std::string& name : dynamics_products(options.trace_file)) {
    if (!same_place(options.save_model, options.output / name)) continue;
    throw bad_request(options.save_model.string(), "is the place of another product",
                      "name another file with --save-model");
  }
  const fs::path folder = options.save_model.parent_path();
  require_writable_folder(folder.empty() ? "." : folder);  // before the long work
}

// The best of those that can be saved.
std::string save_best(const DynamicsOptions& options, const std::vector<FittedTorqueModel>& fitted,
                      const std::optional<TracedLog>& traced, const TorqueSummary& summary) {
  std::vector<TorqueScore> scores = summary.scores;
  const auto parametric = static_cast<std::size_t>(
      std::ranges::find(scores, TorqueModelKind::kParametric, &TorqueScore::kind) - scores.begin());
  for (std::size_t k = 0; k < scores.size(); ++k) {
    // The traced model is saved beside the parametric one.
    const bool saved = k < fitted.size() ? fitted[k].saved != nullptr
                                         : traced && parametric < fitted.size() &&
                                               fitted[parametric].saved != nullptr;
    if (!saved && scores[k].failure.empty()) scores[k].failure = "cannot be saved";
  }
  auto best = static_cast<std::size_t>(best_score(scores));
  if (best >= fitted.size()) best = parametric;
  if (!fitted[best].saved) {
    throw undetermined("--save-model",
                       "no model that can be saved was learned: " + scores[best].failure,
                       "record a longer motion of all joints");
  }
  TorqueModelFile file;
  file.version = program_version();
  file.model = *fitted[best].saved;
  file.filter = {summary.data.filter, summary.data.cutoff.cutoff_hz};
  file.source = summary.data.source;
  if (file.model.kind == TorqueModelKind::kParametric && traced) file.traced = traced->saved;
  write_file_atomically(options.save_model, torque_model_json(file));
  return fmt::format("{}{}", to_string(file.model.kind),
                     file.traced ? " with what tracing found" : "");
}

std::optional<TracedLog> add_trace(const DynamicsOptions& options, const DynamicModel& model,
                                   const TorqueLogReport& log, const OutputFolder& folder,
                                   const Progress& progress, TorqueSummary& summary) {
  TracedLog traced = trace_torque_stage(options, model, log, summary.data.cutoff, folder, progress);
  summary.trace = traced.trace.trace;
  take_traced_drives(traced.trace, model, summary.drives);
  summary.has_traced_robot = traced.has_urdf;
  for (const std::string& note : traced.trace.corrected.notes)
    summary.warnings.push_back("robot_traced.urdf: " + note);
  for (const TracedEffect& effect : summary.trace->accepted) {
    if (effect.id.effect != "gravity_direction") continue;
    summary.traced_gravity_m_s2 = traced.trace.corrected.model.gravity_m_s2;
  }
  if (summary.trace->verdict != TraceVerdict::kNothingToSay) {
    summary.rollout = {roll_out(traced.trace.corrected, model.tree, summary.test),
                       options.test_logs.empty()};
  }
  // Without effects it would be the identified model again, less exactly.
  if (traced.saved.corrected.effects.empty()) return std::nullopt;
  return traced;
}

void take_gravity_of(const TorqueSamples& samples, DynamicModel& model, TorqueSummary& summary) {
  const GravityFromTorques found = gravity_from_torques(model, samples);
  if (!found.contradicts()) return;
  summary.default_gravity_m_s2 = model.gravity_m_s2;
  model.gravity_m_s2 = model.gravity_m_s2.norm() * found.direction;
  summary.gravity_m_s2 = model.gravity_m_s2;
}

}  // namespace

TorqueSummary model_torque(const DynamicsOptions& options, const Progress& progress) {
  Stopwatch clock;
  TorqueSummary summary;
  auto [kinds, models_options, robust] = wanted_models(options);
  models_options.keep_saved = !options.save_model.empty();
  check_savable(options, kinds);
  const TorqueRobot robot = read_torque_robot(options.robot, options.gravity_m_s2);
  DynamicModel model = robot.model;
  const OutputFolder folder(options.output, writer_of(options));
  summary.robot = model.tree.name;
  summary.log = "Log " + file_list(options.logs);
  summary.version = program_version();
  summary.command = options.command_line;
  summary.gravity_m_s2 = model.gravity_m_s2;
  summary.gravity_declared = options.gravity_m_s2.has_value();
  summary.inputs =
      hashed_inputs({options.logs, options.test_logs, options.unloaded_logs, {options.robot}});
  summary.joints = robot.joints;
  summary.types = robot.types;
  const TorqueLogReport log = read_checked_log(recorded::read_channel_tables(options.logs),
                                               wanted_joints(model.tree), options.data);
  if (asks_for_payload(options)) require_payload_question(options, model, log.log.torque_unit);
  summary.data = filtered_data(log, options.data.motion);
  if (options.gravity_from_torques && !options.gravity_m_s2) {
    take_gravity_of(measured_part(summary.data.samples), model, summary);
  }
  // A robot that moves no joint is refused by the fit.
  if (std::ssize(summary.types) == summary.data.samples.joints()) {
    models_options.identify.drives = slow_enough(models_options.identify.drives, summary.types,
                                                 moving_speeds(summary.data.samples));
  }
  const TorqueScales scales = check_scale(options.logs, model, models_options.identify, summary);
  split_samples(options, model, summary);
  check_torque_memory(kinds, summary.train.size(), summary.train.joints(), models_options);
  clock.lap("read", summary.times);

  report_progress(progress, "identify", 0, 0);
  summary.identification = identify_dynamics(model, summary.train, models_options.identify);
  const FittedTorqueModel parametric =
      parametric_model(summary.identification, model, summary.train, models_options);
  // Refuses what it must before the slow fits, and before anything is written.
  require_torques_of_motion(model, summary, log.log, scales, parametric, models_options);
  std::optional<TorqueSamples> unloaded;
  if (asks_for_payload(options)) {
    report_progress(progress, "payload", 0, 0);
    unloaded = add_payload(options, model, summary);
    clock.lap("payload", summary.times);
  }
  summary.consistent = consistent_model(summary.identification);
  summary.drives = drives_of(summary);
  warn_of_driving_friction(summary);
  clock.lap("identify", summary.times);
  // What the model lacks stands in the folder before the slow models begin.
  std::optional<TracedLog> traced;
  std::optional<TracedScore> traced_score;
  if (options.trace) {
    traced = add_trace(options, model, log, folder, progress, summary);
    if (traced) traced_score = score_traced(model, *traced, summary, !options.test_logs.empty());
    clock.lap("trace", summary.times);
  } else {
    remove_torque_trace(options.trace_file, folder);
  }
  const std::vector<FittedTorqueModel> fitted =
      compare(kinds, model, models_options, parametric, traced_score, progress, summary);
  clock.lap("models", summary.times);
  if (!options.save_model.empty())
    summary.saved_model = save_best(options, fitted, traced, summary);
  if (options.learning_curve) {
    report_progress(progress, "learning curve", 0, 0);
    add_learning_curves(kinds, model, models_options, summary);
    clock.lap("learning curve", summary.times);
  }

  if (robust) {
    report_progress(progress, "robust regression", 0, 0);
    add_robust_regressions(model, models_options, summary);
    clock.lap("robust regression", summary.times);
  }
  if (summary.payload && options.robust.value_or(true)) {
    report_progress(progress, "payload at rest", 0, 0);
    add_payload_at_rest(options, model, unloaded, summary);
    clock.lap("payload at rest", summary.times);
  }
  report_progress(progress, "", 0, 0);
  folder.write({{"dynamics.json", json_text(torque_json(summary))},
                {"robot_dynamics.urdf", write_urdf(summary.consistent.model)},
                {"dynamics.html", torque_report_html(summary)}});
  return summary;
}

}  // namespace kinescope
