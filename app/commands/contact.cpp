// SPDX-License-Identifier: Apache-2.0
//
// `kinescope contact`: from a log with torques and a robot with masses to the contacts in it.
#include <algorithm>
#include <cstdio>
#include <limits>

#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/commands/contact_model.h"
#include "app/commands/output_folder.h"
#include "app/commands/torque_inputs.h"
#include "app/commands/torque_stages.h"
#include "dynamics/contact/momentum_observer.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr double kObserverGain = 25.0;  // 1/s, of the report's time line

TorqueLogReport read_log(const std::vector<fs::path>& files, const DynamicModel& model,
                         const TorqueDataOptions& options) {
  TorqueLogReport log = look_at_torque_log(files, wanted_joints(model.tree), options);
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

LogBalance balance_of(const ContactModel& model, const TorqueLogReport& report,
                      const TorqueDataOptions& options, double guard_s) {
  const TorqueLog& log = report.log;
  const ModelDoubt doubt = model_doubt(model, report, options);
  const std::vector<TorqueSamples> parts = unfiltered(log, model.gains);
  LogBalance out;
  out.clock = {apart(parts, guard_s), log.trajectory_names};
  for (const TorqueSamples& part : parts) {
    const std::vector<BalanceSample> samples =
        balance_samples(model, part, doubt, log.dq.cols() > 0);
    out.samples.insert(out.samples.end(), samples.begin(), samples.end());
  }
  for (std::size_t i = 0; i < out.samples.size(); ++i) {
    out.samples[i].stamp_s = out.clock.clock.time_s()[static_cast<Eigen::Index>(i)];
  }
  return out;
}

// External torques and their noise as the log would show them.
void apply_gains(const Eigen::VectorXd& gains, ContactSummary& summary) {
  for (ContactEvent& event : summary.events) {
    event.torque = event.torque.cwiseProduct(gains);
    event.torque_covariance = gains.asDiagonal() * event.torque_covariance * gains.asDiagonal();
  }
  summary.external_torque = gains.asDiagonal() * summary.external_torque;
  BalanceNoise& noise = summary.calibration.noise;
  noise.torque_sigma = noise.torque_sigma.cwiseProduct(gains);
  noise.model_sigma = noise.model_sigma.cwiseProduct(gains);
}

Writer writer_of(const ContactCommandOptions& options) {
  std::vector<fs::path> inputs{options.robot};
  for (const auto* logs : {&options.logs, &options.learn_logs}) {
    inputs.insert(inputs.end(), logs->begin(), logs->end());
  }
  return {.command = options.owner,
          .products = contact_products(),
          .inputs = std::move(inputs),
          .force = options.force};
}

void print_result(const ContactSummary& summary, const fs::path& folder, const Console& console) {
  if (console.json) {
    fmt::print("{}\n", contact_json(summary).dump(2));
    return;
  }
  fmt::print("{}\ncontacts  {}\nreport    {}\n", contact_verdict(summary),
             (folder / "contacts.csv").string(), (folder / "contact.html").string());
}

}  // namespace

ContactSummary find_contacts(const ContactCommandOptions& options) {
  ContactSummary summary;
  const TorqueRobot robot = read_torque_robot(options.robot, options.gravity_m_s2);
  const DynamicModel& model = robot.model;
  validate(options.contact);
  const OutputFolder folder(options.output, writer_of(options));
  summary.robot = model.tree.name;
  summary.log = "Log " + file_list(options.logs);
  summary.version = program_version();
  summary.command = options.command_line;
  summary.inputs = hashed_inputs({options.logs, options.learn_logs, {options.robot}});
  summary.joints = robot.joints;
  summary.types = robot.types;
  summary.links = robot.links;
  const TorqueLogReport log = read_log(options.logs, model, options.data);
  const bool learn_apart = !options.learn_logs.empty();
  const TorqueLogReport learn =
      learn_apart ? read_log(options.learn_logs, model, options.data) : log;
  summary.torque_unit = log.log.torque_unit;
  summary.learned = learn_apart ? file_list(options.learn_logs) : "the log itself";
  const ContactModel expected = make_contact_model(options, model, log, learn);
  summary.model = expected.words;
  summary.findings = log.findings;
  summary.findings.insert(summary.findings.begin(), expected.findings.begin(),
                          expected.findings.end());

  ContactOptions contact = options.contact;
  for (const RigidBody& body : make_rigid_model(model).bodies) {
    contact.parents.push_back(body.parent);
  }
  const LogBalance looked_at = balance_of(expected, log, options.data, contact.guard_s);
  const LogBalance learned =
      learn_apart ? balance_of(expected, learn, options.data, contact.guard_s) : looked_at;
  const std::vector<BalanceSample>& samples = looked_at.samples;
  summary.clock = looked_at.clock;
  summary.learn_clock = learned.clock;
  summary.calibration = calibrate_contacts(learned.samples, contact);

  summary.events = detect_contacts(summary.calibration, samples);
  std::vector<TimeSpan> spans;
  spans.reserve(summary.events.size());
  for (const ContactEvent& event : summary.events) spans.push_back({event.onset_s, event.end_s});
  summary.check = check_false_alarms(summary.calibration, samples, spans);
  summary.external_torque = observe_momentum(samples, kObserverGain);
  summary.t_s = summary.clock.clock.time_s();
  apply_gains(expected.gains, summary);

  folder.write("contacts.csv", contacts_csv(summary));
  folder.write("contacts.json", contact_json(summary).dump(1) + "\n");
  folder.write("contact.html", contact_report_html(summary));
  return summary;
}

ExitCode contact_command(const ContactCommandOptions& options, const Console& console) {
  const ContactSummary summary = find_contacts(options);
  print_result(summary, options.output, console);
  return ExitCode::kDone;
}

}  // namespace kinescope
