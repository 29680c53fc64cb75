// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <fmt/format.h>

#include "app/report/contact_summary.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::number;
using report::numbers;
using report::text;

std::string link_name(const ContactSummary& summary, int link) {
  const auto at = static_cast<std::size_t>(link);
  return link >= 0 && at < summary.links.size() ? summary.links[at] : "unknown";
}

double link_probability(const ContactEvent& event) {
  return event.link >= 0 && event.link < event.link_probability.size()
             ? event.link_probability[event.link]
             : 0.0;
}

json event_json(const ContactSummary& summary, const ContactEvent& event) {
  const LogClock& clock = summary.clock;
  return {{"trajectory", text(clock.trajectory(event.onset_s))},
          {"onset_s", number(clock.time_s(event.onset_s))},
          {"end_s", number(clock.time_s(event.end_s))},
          {"alarm_s", number(clock.time_s(event.alarm_s))},
          {"link", text(link_name(summary, event.link))},
          {"probability", number(link_probability(event))},
          {"open", event.open},
          {"torque", numbers(event.torque)},
          {"torque_sigma", numbers(event.torque_covariance.diagonal().cwiseMax(0.0).cwiseSqrt())},
          {"statistic", number(event.statistic)}};
}

json calibration_json(const ContactCalibration& calibration, const LogClock& clock) {
  json excluded = json::array();
  for (const TimeSpan& span : calibration.excluded) {
    excluded.push_back({{"trajectory", text(clock.trajectory(span.begin_s))},
                        {"begin_s", number(clock.time_s(span.begin_s))},
                        {"end_s", number(clock.time_s(span.end_s))}});
  }
  return {{"declared_per_hour", number(calibration.options.false_alarms_per_hour)},
          {"thresholds", numbers(calibration.thresholds)},
          {"exposure_s", number(calibration.exposure_s)},
          {"excluded", excluded},
          {"noise",
           {{"velocity_sigma", numbers(calibration.noise.velocity_sigma)},
            {"torque_sigma", numbers(calibration.noise.torque_sigma)},
            {"model_sigma", numbers(calibration.noise.model_sigma)},
            {"model_time_s", numbers(calibration.noise.model_time_s)}}}};
}

// A cell of a CSV file, in quotes where it needs them.
std::string cell(const std::string& value) {
  if (value.find_first_of(",\"\r\n") == std::string::npos) return value;
  std::string out = "\"";
  for (const char c : value) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace

std::string contacts_csv(const ContactSummary& summary) {
  std::string out = "onset_s,end_s,alarm_s,link,probability,open,trajectory";
  for (const std::string& joint : summary.joints) {
    out += fmt::format(",torque_{},sigma_{}", joint, joint);
  }
  out += "\n";
  for (const ContactEvent& event : summary.events) {
    const LogClock& clock = summary.clock;
    out += fmt::format("{},{},{},{},{},{},{}", clock.time_s(event.onset_s),
                       clock.time_s(event.end_s), clock.time_s(event.alarm_s),
                       link_name(summary, event.link), link_probability(event), event.open ? 1 : 0,
                       cell(clock.trajectory(event.onset_s)));
    for (Eigen::Index j = 0; j < event.torque.size(); ++j) {
      out += fmt::format(",{},{}", event.torque[j],
                         std::sqrt(std::max(0.0, event.torque_covariance(j, j))));
    }
    out += "\n";
  }
  return out;
}

json contact_json(const ContactSummary& summary) {
  json events = json::array();
  for (const ContactEvent& event : summary.events) events.push_back(event_json(summary, event));
  json findings = json::array();
  for (const LogFinding& finding : summary.findings) findings.push_back(text(to_line(finding)));
  return {{"schema", "kinescope.contact"},
          {"schema_version", 1},
          {"robot", text(summary.robot)},
          {"version", text(summary.version)},
          {"unit", text(summary.torque_unit)},
          {"joints", report::texts(summary.joints)},
          {"links", report::texts(summary.links)},
          {"learned", text(summary.learned)},
          {"model", text(summary.model)},
          {"inputs", report::inputs_json(summary.inputs)},
          {"findings", findings},
          {"calibration", calibration_json(summary.calibration, summary.learn_clock)},
          {"check",
           {{"hours", number(summary.check.hours)},
            {"extrapolated_per_hour", number(summary.check.extrapolated_per_hour)}}},
          {"contacts", events}};
}

std::string contact_verdict(const ContactSummary& summary) {
  const std::string rate = fmt::format("false alarms: {:g} an hour asked for, {:.2g} estimated",
                                       summary.calibration.options.false_alarms_per_hour,
                                       summary.check.extrapolated_per_hour);
  if (summary.events.empty())
    return fmt::format("No contact in {:.1f} s ({}).", 3600.0 * summary.check.hours, rate);
  std::string out = fmt::format("{} contact{} ({}):", summary.events.size(),
                                summary.events.size() == 1 ? "" : "s", rate);
  for (const ContactEvent& event : summary.events) {
    const std::string of = summary.clock.names.size() > 1
                               ? fmt::format(" of {}", summary.clock.trajectory(event.onset_s))
                               : "";
    out += fmt::format(" {:.2f} to {:.2f} s{} at {};", summary.clock.time_s(event.onset_s),
                       summary.clock.time_s(event.end_s), of, link_name(summary, event.link));
  }
  out.back() = '.';
  return out;
}

}  // namespace kinescope
