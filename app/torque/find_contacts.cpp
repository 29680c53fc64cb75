// SPDX-License-Identifier: Apache-2.0
#include "app/torque/find_contacts.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/torque/contact_loads.h"
#include "app/torque/contact_model.h"
#include "app/torque/contact_predictor.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/contact/momentum_observer.h"
#include "kinematics/core/error.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr double kObserverGain = 25.0;  // 1/s, of the report's time line

TorqueLogReport read_log(const std::vector<fs::path>& files, const DynamicModel& model,
                         const TorqueDataOptions& options) {
  TorqueLogReport log =
      look_at_torque_log(recorded::read_channel_tables(files), wanted_joints(model.tree), options);
  throw_refusals(log.findings);
  if (log.log.torque.cols() == 0) {
    throw bad_input(files.front().string(), "has no torque columns",
                    "name them with --torque, or log motor currents with --torque-unit A");
  }
  return log;
}

// What contact detection looks at: the trajectories of a log on one clock.
struct LogBalance {
  std::vector<BalanceSample> samples;
  LogClock clock;
  Eigen::VectorXd torque_variance;  // about each joint's mean, as measured
  std::vector<TimeSpan> loaded;     // spans in which a load lasts

  // What is learned from.
  [[nodiscard]] std::vector<BalanceSample> unloaded(double guard_s) const {
    std::vector<BalanceSample> out;
    for (const BalanceSample& sample : samples) {
      const bool is_loaded = std::ranges::any_of(loaded, [&](const TimeSpan& span) {
        return sample.stamp_s >= span.begin_s - guard_s && sample.stamp_s <= span.end_s + guard_s;
      });
      if (!is_loaded) out.push_back(sample);
    }
    return out;
  }
};

// Far enough apart that detection begins anew in each, and what is left out around a contact stays
// in its own.
OneClock apart(const std::vector<TorqueSamples>& parts, double guard_s) {
  Eigen::Index rows = 0;
  for (const TorqueSamples& part : parts) rows += part.size();
  Eigen::VectorXd t_s(rows);
  Eigen::VectorXi trajectory(rows);
  Eigen::Index at = 0;
  for (const TorqueSamples& part : parts) {
    t_s.segment(at, part.size()) = part.t_s;
    trajectory.segment(at, part.size()) = part.trajectory;
    at += part.size();
  }
  const double gap_s = 1.0 + guard_s;
  return {t_s, trajectory, {.least_gap_s = gap_s, .gap_s = gap_s}};
}

// What detection looks at, and what it learns from where that is another log.
struct Balances {
  LogBalance looked_at;
  std::optional<LogBalance> learned;
};

Eigen::VectorXd variance_of_torque(const std::vector<TorqueSamples>& parts) {
  Eigen::Index rows = 0;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(parts.front().torque.cols());
  for (const TorqueSamples& part : parts) {
    sum += part.torque.colwise().sum().transpose();
    rows += part.size();
  }
  const Eigen::RowVectorXd mean = sum.transpose() / static_cast<double>(rows);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(sum.size());
  for (const TorqueSamples& part : parts)
    squares += (part.torque.rowwise() - mean).colwise().squaredNorm().transpose();
  return squares / static_cast<double>(rows);
}

// Of consecutive samples, those that are loaded.
std::vector<TimeSpan> spans_of(const std::vector<char>& loaded, const Eigen::VectorXd& time_s) {
  std::vector<TimeSpan> out;
  for (std::size_t i = 0; i < loaded.size(); ++i) {
    if (loaded[i] == 0) continue;
    const double stamp_s = time_s[static_cast<Eigen::Index>(i)];
    if (i == 0 || loaded[i - 1] == 0) out.push_back({.begin_s = stamp_s});
    out.back().end_s = stamp_s;
  }
  return out;
}

LogBalance on_one_clock(const std::vector<TorqueSamples>& parts,
                        const std::vector<std::vector<BalanceSample>>& samples,
                        const TorqueLog& log, const std::vector<TrajectorySpan>& loads,
                        double guard_s) {
  LogBalance out;
  out.clock = {apart(parts, guard_s), log.trajectory_names};
  out.torque_variance = variance_of_torque(parts);
  for (const auto& part : samples) {
    out.samples.insert(out.samples.end(), part.begin(), part.end());
  }
  for (std::size_t i = 0; i < out.samples.size(); ++i) {
    out.samples[i].stamp_s = out.clock.clock.time_s()[static_cast<Eigen::Index>(i)];
  }
  std::vector<char> loaded;
  for (const TorqueSamples& part : parts) {
    const std::vector<char> own =
        loaded_rows(part.t_s, part.trajectory, log.trajectory_names, loads);
    loaded.insert(loaded.end(), own.begin(), own.end());
  }
  out.loaded = spans_of(loaded, out.clock.clock.time_s());
  return out;
}

LogBalance balance_of(const ContactModel& model, const TorqueLogReport& report,
                      const std::vector<TrajectorySpan>& loads, const TorqueDataOptions& options,
                      double guard_s) {
  const TorqueLog& log = report.log;
  const ModelDoubt doubt = model_doubt(model, report, options);
  const std::vector<TorqueSamples> parts = unfiltered(log, model.gains);
  std::vector<std::vector<BalanceSample>> samples;
  for (const TorqueSamples& part : parts) {
    samples.push_back(balance_samples(model, part, doubt, log.dq.cols() > 0));
  }
  return on_one_clock(parts, samples, log, loads, guard_s);
}

LogBalance balance_of(const TorqueModelFile& file, const std::vector<PredictedFriction>& friction,
                      const PredictedLog& predicted, const TorqueLog& log,
                      const std::vector<TrajectorySpan>& loads, double guard_s) {
  std::vector<std::vector<BalanceSample>> samples;
  for (std::size_t m = 0; m < predicted.motions.size(); ++m) {
    samples.push_back(
        predicted_balance(file.model.rigid, friction, predicted.motions[m], predicted.torques[m]));
  }
  return on_one_clock(predicted.motions, samples, log, loads, guard_s);
}

struct DetectedContacts {
  ContactCalibration calibration;
  std::vector<ContactEvent> events;
};

DetectedContacts detect(const Balances& balances, const ContactOptions& options) {
  DetectedContacts out;
  const LogBalance& looked_at = balances.looked_at;
  const LogBalance& learned = balances.learned ? *balances.learned : looked_at;
  const std::vector<BalanceSample> samples = looked_at.unloaded(options.guard_s);
  out.calibration = balances.learned
                        ? calibrate_contacts(learned.unloaded(options.guard_s), samples, options)
                        : calibrate_contacts(samples, options);
  std::vector<TimeSpan>& excluded = out.calibration.excluded;
  excluded.insert(excluded.end(), learned.loaded.begin(), learned.loaded.end());
  std::ranges::sort(excluded, {}, &TimeSpan::begin_s);
  out.events = detect_contacts(out.calibration, looked_at.samples, looked_at.loaded);
  return out;
}

// External torques and their noise as the log would show them.
void apply_gains(const Eigen::VectorXd& gains, std::vector<ContactEvent>& events) {
  for (ContactEvent& event : events) {
    event.torque = event.torque.cwiseProduct(gains);
    event.torque_covariance = gains.asDiagonal() * event.torque_covariance * gains.asDiagonal();
  }
}

void apply_gains(const Eigen::VectorXd& gains, ContactSummary& summary) {
  apply_gains(gains, summary.events);
  summary.external_torque = gains.asDiagonal() * summary.external_torque;
  BalanceNoise& noise = summary.calibration.noise;
  noise.torque_sigma = noise.torque_sigma.cwiseProduct(gains);
  noise.model_sigma = noise.model_sigma.cwiseProduct(gains);
}

// The logs as they were read.
struct Logs {
  TorqueLogReport looked_at;
  std::optional<TorqueLogReport> learn;
  std::vector<TrajectorySpan> loads, learn_loads;  // that last, in each of them
  std::optional<TorqueLogReport> unloaded;         // the one to learn from, without

  [[nodiscard]] const TorqueLogReport& to_learn_from() const {
    return unloaded ? *unloaded : learn ? *learn : looked_at;
  }
};

Logs read_logs(const ContactCommandOptions& options, const DynamicModel& model) {
  Logs out;
  out.looked_at = read_log(options.logs, model, options.data);
  if (options.learn_logs.empty()) return out;
  out.learn = read_log(options.learn_logs, model, options.data);
  const std::string& unit = out.looked_at.log.torque_unit;
  if (out.learn->log.torque_unit != unit) {
    throw bad_input(options.learn_logs.front().string(),
                    fmt::format("is in {}, the log in {}", out.learn->log.torque_unit, unit),
                    "learn from a log of the same signals");
  }
  return out;
}

// What lasts is found by how it differs from the rest of its log, and before anything is learned.
void find_loads(const ContactCommandOptions& options, const DynamicModel& model, Logs& logs) {
  Eigen::VectorXd gains = Eigen::VectorXd::Ones(logs.looked_at.log.torque.cols());
  if (logs.looked_at.log.torque_unit == "A") {
    try {
      gains = make_contact_model(options, model, logs.looked_at, logs.to_learn_from()).gains;
    } catch (const Error& error) {
      if (error.code() != ExitCode::kUndetermined) throw;
      return;
    }
  }
  logs.loads = loads_in(logs.looked_at, model, gains, options);
  logs.learn_loads = logs.learn ? loads_in(*logs.learn, model, gains, options) : logs.loads;
  if (!logs.learn_loads.empty())
    logs.unloaded = without_loads(logs.to_learn_from(), logs.learn_loads);
}

// Joints of whose torque a constant would leave less, outside the contacts, than the model does.
std::vector<std::string> unfit_joints(const LogBalance& of, const ContactSummary& summary) {
  std::vector<std::string> out;
  const auto is_free = [&](double stamp_s) {
    return std::ranges::none_of(summary.events, [&](const ContactEvent& event) {
      return event.onset_s <= stamp_s && stamp_s <= event.end_s;
    });
  };
  const Eigen::Index joints = of.torque_variance.size();
  Eigen::ArrayXd count = Eigen::ArrayXd::Zero(joints);
  Eigen::ArrayXd sum = count;
  Eigen::ArrayXd squares = count;
  for (std::size_t i = 0; i < of.samples.size(); ++i) {
    if (!is_free(of.samples[i].stamp_s)) continue;
    for (Eigen::Index j = 0; j < joints; ++j) {
      if (of.samples[i].may_stick(j)) continue;
      const double left = summary.external_torque(j, static_cast<Eigen::Index>(i));
      count[j] += 1.0;
      sum[j] += left;
      squares[j] += left * left;
    }
  }
  for (Eigen::Index j = 0; j < joints; ++j) {
    if (count[j] > 0.0 &&
        squares[j] - sum[j] * sum[j] / count[j] > count[j] * of.torque_variance[j])
      out.push_back(summary.joints[static_cast<std::size_t>(j)]);
  }
  return out;
}

void report_detection(const Balances& balances, DetectedContacts found, ContactSummary& summary) {
  const LogBalance& looked_at = balances.looked_at;
  summary.clock = looked_at.clock;
  summary.learn_clock = balances.learned ? balances.learned->clock : looked_at.clock;
  summary.calibration = std::move(found.calibration);
  summary.events = std::move(found.events);
  std::vector<TimeSpan> spans;
  spans.reserve(summary.events.size());
  for (const ContactEvent& event : summary.events) spans.push_back({event.onset_s, event.end_s});
  summary.check = check_false_alarms(summary.calibration, looked_at.samples, spans);
  summary.external_torque = observe_momentum(looked_at.samples, kObserverGain);
  summary.t_s = summary.clock.clock.time_s();
  summary.unfit = summary.unmeasured;
  for (std::string& joint : unfit_joints(looked_at, summary))
    summary.unfit.push_back(std::move(joint));
}

Balances momentum_balances(const ContactModel& expected, const Logs& logs,
                           const ContactCommandOptions& options, double guard_s) {
  Balances out{.looked_at = balance_of(expected, logs.looked_at, logs.loads, options.data, guard_s),
               .learned = {}};
  if (logs.learn)
    out.learned = balance_of(expected, *logs.learn, logs.learn_loads, options.data, guard_s);
  return out;
}

void find_by_momentum(const ContactCommandOptions& options, const DynamicModel& model,
                      const Logs& logs, const ContactOptions& contact, ContactSummary& summary) {
  const ContactModel expected =
      make_contact_model(options, model, logs.looked_at, logs.to_learn_from());
  summary.model = expected.words;
  summary.findings.insert(summary.findings.begin(), expected.findings.begin(),
                          expected.findings.end());
  const Balances balances = momentum_balances(expected, logs, options, contact.guard_s);
  report_detection(balances, detect(balances, contact), summary);
  apply_gains(expected.gains, summary);
}

// Beside a torque model, where it can be computed.
MomentumComparison compare_with_momentum(const ContactCommandOptions& options,
                                         const DynamicModel& model, const Logs& logs,
                                         const ContactOptions& contact) {
  MomentumComparison out;
  try {
    const ContactModel expected =
        make_contact_model(options, model, logs.looked_at, logs.to_learn_from());
    const Balances balances = momentum_balances(expected, logs, options, contact.guard_s);
    DetectedContacts found = detect(balances, contact);
    out.events = std::move(found.events);
    apply_gains(expected.gains, out.events);
    out.excluded = std::move(found.calibration.excluded);
    out.clock = balances.looked_at.clock;
    out.learn_clock = balances.learned ? balances.learned->clock : balances.looked_at.clock;
    out.model = expected.words;
  } catch (const Error& error) {
    out.reason = error.what();
  }
  return out;
}

// What looks like contact to the momentum balance, in the log to learn from.
std::vector<TrajectorySpan> spans_to_leave_out(const MomentumComparison& momentum, double guard_s) {
  std::vector<TrajectorySpan> out;
  for (const TimeSpan& span : momentum.excluded) {
    out.push_back({.trajectory = momentum.learn_clock.trajectory(span.begin_s),
                   .begin_s = momentum.learn_clock.time_s(span.begin_s) - guard_s,
                   .end_s = momentum.learn_clock.time_s(span.end_s) + guard_s});
  }
  return out;
}

const std::vector<fs::path>& files_to_learn_from(const ContactCommandOptions& options) {
  return options.learn_logs.empty() ? options.logs : options.learn_logs;
}

void find_by_prediction(const ContactCommandOptions& options, const DynamicModel& model,
                        ContactModelChoice choice, const Logs& logs, const ContactOptions& contact,
                        ContactSummary& summary) {
  summary.momentum = compare_with_momentum(options, model, logs, contact);
  summary.method = to_string(choice.kind);
  const std::string origin =
      choice.file ? fs::path(options.model).filename().string()
                  : file_list(files_to_learn_from(options)) + ", outside what looks like contact";
  if (!choice.file) {
    choice.file =
        learn_contact_model(choice.kind, model, logs.to_learn_from(),
                            spans_to_leave_out(*summary.momentum, contact.guard_s), options.data);
  }
  const TorqueModelFile& file = *choice.file;
  summary.model = fmt::format(
      "the {} model{} of {} ({} samples), drift of friction and offsets of "
      "the log",
      summary.method, file.traced ? " with what tracing found" : "", origin, file.model.samples);
  PredictedLog looked_at = predict_log(file, logs.looked_at, options.logs, options.data);
  std::optional<PredictedLog> learn;
  if (logs.learn) learn = predict_log(file, *logs.learn, options.learn_logs, options.data);
  keep_usable_inertia(file, looked_at, learn);
  std::vector<PredictedFriction> friction = friction_beside(
      file, without_loads(learn ? *learn : looked_at, logs.to_learn_from().log.trajectory_names,
                          logs.learn_loads));
  for (const Eigen::Index j : unmeasured_joints(logs.looked_at.log, logs.to_learn_from().log))
    friction[static_cast<std::size_t>(j)] = {};
  Balances balances{.looked_at = balance_of(file, friction, looked_at, logs.looked_at.log,
                                            logs.loads, contact.guard_s),
                    .learned = {}};
  if (learn)
    balances.learned =
        balance_of(file, friction, *learn, logs.learn->log, logs.learn_loads, contact.guard_s);
  summary.new_motion = std::move(looked_at.new_motion);
  report_detection(balances, detect(balances, contact), summary);
}

Writer writer_of(const ContactCommandOptions& options,
                 const std::optional<ContactModelChoice>& choice) {
  std::vector<fs::path> inputs{options.robot};
  if (choice && choice->file) inputs.emplace_back(options.model);
  for (const auto* logs : {&options.logs, &options.learn_logs}) {
    inputs.insert(inputs.end(), logs->begin(), logs->end());
  }
  return {.command = options.owner,
          .products = contact_products(),
          .inputs = std::move(inputs),
          .force = options.force};
}

}  // namespace

ContactSummary find_contacts(const ContactCommandOptions& options) {
  ContactSummary summary;
  const TorqueRobot robot = read_torque_robot(options.robot, options.gravity_m_s2);
  const DynamicModel& model = robot.model;
  validate(options.contact);
  std::optional<ContactModelChoice> choice;
  if (!options.model.empty()) choice = choose_contact_model(options, model);
  const Writer writer = writer_of(options, choice);
  const OutputFolder folder(options.output, writer);
  summary.robot = model.tree.name;
  summary.log = "Log " + file_list(options.logs);
  summary.version = program_version();
  summary.command = options.command_line;
  summary.inputs = hashed_inputs({options.logs, options.learn_logs, {options.robot}});
  summary.joints = robot.joints;
  summary.types = robot.types;
  summary.links = robot.links;
  Logs logs = read_logs(options, model);
  find_loads(options, model, logs);
  summary.torque_unit = logs.looked_at.log.torque_unit;
  summary.learned =
      logs.learn ? file_list(options.learn_logs) + " and the log itself" : "the log itself";
  summary.findings = logs.looked_at.findings;
  for (const Eigen::Index j : unmeasured_joints(logs.looked_at.log, logs.to_learn_from().log))
    summary.unmeasured.push_back(summary.joints[static_cast<std::size_t>(j)]);

  ContactOptions contact = options.contact;
  for (const RigidBody& body : make_rigid_model(model).bodies) {
    contact.parents.push_back(body.parent);
  }
  if (choice) {
    if (choice->file) {
      summary.inputs.push_back(hashed_inputs({{options.model}}).front());
      require_unit_of(*choice->file, logs.looked_at, options.logs);
    }
    find_by_prediction(options, model, std::move(*choice), logs, contact, summary);
  } else {
    find_by_momentum(options, model, logs, contact, summary);
  }

  folder.write({{"contacts.csv", contacts_csv(summary)},
                {"contacts.json", json_text(contact_json(summary))},
                {"contact.html", contact_report_html(summary)}});
  return summary;
}

}  // namespace kinescope
