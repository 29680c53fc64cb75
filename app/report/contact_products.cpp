// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/report/contact_summary.h"
#include "app/report/quoted_cell.h"
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

json event_json(const ContactSummary& summary, const LogClock& clock, const ContactEvent& event) {
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

json events_json(const ContactSummary& summary, const LogClock& clock,
                 const std::vector<ContactEvent>& events) {
  json out = json::array();
  for (const ContactEvent& event : events) out.push_back(event_json(summary, clock, event));
  return out;
}

json momentum_json(const ContactSummary& summary) {
  if (!summary.momentum) return nullptr;
  const MomentumComparison& own = *summary.momentum;
  return {{"model", text(own.model)},
          {"reason", text(own.reason)},
          {"contacts", events_json(summary, own.clock, own.events)}};
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

std::string counted(std::size_t count) {
  return fmt::format("{} contact{}", count, count == 1 ? "" : "s");
}

// The link; where it is less likely than the others together, only that none before it was touched.
std::string place_words(const ContactSummary& summary, const ContactEvent& event) {
  std::string name = link_name(summary, event.link);
  if (event.link < 0 || event.link >= event.link_probability.size()) return name;
  const double itself = link_probability(event);
  if (itself >= 0.5) return name;
  return fmt::format("{} or beyond it ({} itself: {:.0f} %)", name, name, 100.0 * itself);
}

std::string found_words(const ContactSummary& summary) {
  const std::string rate = fmt::format("false alarms: {:g} an hour asked for, {:.2g} estimated",
                                       summary.calibration.options.false_alarms_per_hour,
                                       summary.check.extrapolated_per_hour);
  if (summary.events.empty())
    return fmt::format("No contact in {:.1f} s ({}).", 3600.0 * summary.check.hours, rate);
  std::string out = fmt::format("{} ({}):", counted(summary.events.size()), rate);
  for (const ContactEvent& event : summary.events) {
    const std::string of = summary.clock.names.size() > 1
                               ? fmt::format(" of {}", summary.clock.trajectory(event.onset_s))
                               : "";
    out += fmt::format(" {:.2f} to {:.2f} s{} at {};", summary.clock.time_s(event.onset_s),
                       summary.clock.time_s(event.end_s), of, place_words(summary, event));
  }
  out.back() = '.';
  return out;
}

std::string unfit_words(const ContactSummary& summary) {
  std::vector<std::string> contradicted = summary.unfit;
  std::erase_if(contradicted, [&](const std::string& joint) {
    return std::ranges::find(summary.unmeasured, joint) != summary.unmeasured.end();
  });
  std::string out;
  if (!summary.unmeasured.empty()) {
    out = fmt::format(
        " Nothing is known of contact at {}, whose torque never changes and was left out: check "
        "its sensor.",
        fmt::join(summary.unmeasured, ", "));
  }
  if (contradicted.empty()) return out;
  return out + fmt::format(
                   " Nothing is known of contact at {}: the model leaves more of the torque there "
                   "than a constant would. Check that the columns are this robot's joints, their "
                   "units, signs and zeros.",
                   fmt::join(contradicted, ", "));
}

// How the momentum balance sees the same log.
std::string momentum_words(const ContactSummary& summary) {
  const MomentumComparison& other = *summary.momentum;
  if (!other.reason.empty()) {
    return fmt::format("The momentum balance says nothing here: {}.", other.reason);
  }
  const auto same = same_contacts(summary);
  const auto shared = std::ranges::count_if(same, [](const auto& at) { return at.has_value(); });
  return fmt::format("The momentum balance on the same log: {}; {} of the above {} among them.",
                     counted(other.events.size()), shared, shared == 1 ? "is" : "are");
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
                       report::quoted_cell(clock.trajectory(event.onset_s)));
    for (Eigen::Index j = 0; j < event.torque.size(); ++j) {
      out += fmt::format(",{},{}", event.torque[j],
                         std::sqrt(std::max(0.0, event.torque_covariance(j, j))));
    }
    out += "\n";
  }
  return out;
}

json contact_json(const ContactSummary& summary) {
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
          {"method", text(summary.method)},
          {"model", text(summary.model)},
          {"inputs", report::inputs_json(summary.inputs)},
          {"findings", findings},
          {"new_motion", report::texts(summary.new_motion)},
          {"unfit", report::texts(summary.unfit)},
          {"calibration", calibration_json(summary.calibration, summary.learn_clock)},
          {"check",
           {{"hours", number(summary.check.hours)},
            {"extrapolated_per_hour", number(summary.check.extrapolated_per_hour)}}},
          {"contacts", events_json(summary, summary.clock, summary.events)},
          {"momentum", momentum_json(summary)}};
}

std::vector<std::optional<std::size_t>> same_contacts(const ContactSummary& summary) {
  std::vector<std::optional<std::size_t>> out(summary.events.size());
  if (!summary.momentum) return out;
  const MomentumComparison& other = *summary.momentum;
  const double guard_s = summary.calibration.options.guard_s;
  for (std::size_t k = 0; k < out.size(); ++k) {
    const ContactEvent& own = summary.events[k];
    for (std::size_t m = 0; m < other.events.size() && !out[k]; ++m) {
      const ContactEvent& event = other.events[m];
      const bool same =
          other.clock.trajectory(event.onset_s) == summary.clock.trajectory(own.onset_s) &&
          other.clock.time_s(event.onset_s) <= summary.clock.time_s(own.end_s) + guard_s &&
          other.clock.time_s(event.end_s) >= summary.clock.time_s(own.onset_s) - guard_s;
      if (same) out[k] = m;
    }
  }
  return out;
}

std::string contact_verdict(const ContactSummary& summary) {
  if (!summary.momentum) return found_words(summary) + unfit_words(summary);
  return fmt::format("By what the {} model does not predict: {}{} {}", summary.method,
                     found_words(summary), unfit_words(summary), momentum_words(summary));
}

}  // namespace kinescope
