// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include "app/report/contact_summary.h"
#include "app/report/html.h"
#include "app/report/page.h"
#include "app/report/plot.h"
#include "app/report/reproduction.h"
#include "app/report/sections.h"
#include "app/report/torque_unit.h"

namespace kinescope::report {
namespace {

constexpr Eigen::Index kMostContactPoints = 1200;  // of one curve
std::vector<ContentsEntry> contents(const ContactSummary& summary) {
  std::vector<ContentsEntry> out{{"verdict", "Verdict"}, {"timeline", "Contact time line"}};
  if (summary.momentum) out.push_back({"comparison", "Beside the momentum balance"});
  out.push_back({"calibration", "Noise and thresholds"});
  out.push_back({"reproduce", "How to reproduce"});
  return out;
}

std::string contact_table(const ContactSummary& summary, const nlohmann::json& document) {
  if (summary.events.empty()) return "";
  Table table("contacts-table",
              fmt::format("Contacts; mean external torque from onset to end, in {} (k = 2; grey: "
                          "not beyond its uncertainty)",
                          common_unit(summary.torque_unit, summary.types)),
              document);
  std::vector<std::string> head = {"Onset, s", "End, s", "Known after, ms", "Link",
                                   "Probability of the link, %"};
  const bool several = summary.clock.names.size() > 1;
  if (several) head.insert(head.begin(), "Log");
  head.insert(head.end(), summary.joints.begin(), summary.joints.end());
  table.header(head);
  for (std::size_t k = 0; k < summary.events.size(); ++k) {
    const ContactEvent& event = summary.events[k];
    const std::string at = fmt::format("/contacts/{}", k);
    table.begin_row();
    if (several) table.text(document.at("contacts")[k].at("trajectory").get<std::string>());
    table.text(fmt::format("{:.2f}", summary.clock.time_s(event.onset_s)));
    table.text(fmt::format("{:.2f}", summary.clock.time_s(event.end_s)));
    table.text(fmt::format("{:.0f}", 1e3 * (event.alarm_s - event.onset_s)));
    table.text(document.at("contacts")[k].at("link").get<std::string>());
    table.number(at + "/probability", Quantity::kPercent);
    for (Eigen::Index j = 0; j < event.torque.size(); ++j) {
      const double expanded =
          kCoverageFactor * std::sqrt(std::max(0.0, event.torque_covariance(j, j)));
      const std::string value = value_and_uncertainty(event.torque[j], expanded, Quantity::kPlain);
      table.html(std::abs(event.torque[j]) > expanded
                     ? value
                     : fmt::format("<span class=\"note\">{}</span>", value));
    }
  }
  return table.str();
}

// When and where both see a contact, by the torque model and by the momentum balance.
std::string comparison(const ContactSummary& summary, const nlohmann::json& document) {
  if (!summary.momentum) return "";
  const MomentumComparison& other = *summary.momentum;
  std::string out = section_head("comparison", "Beside the momentum balance");
  if (!other.reason.empty()) {
    return out + paragraph("The momentum balance says nothing here: " + other.reason + ".") +
           "</section>\n";
  }
  out +=
      paragraph(fmt::format("The same detector on the balance of momentum, at the same rate of "
                            "false alarms; masses: {}.",
                            other.model));
  Table table("momentum-table", "Contacts by both", document);
  table.header({"Log", "Onset, s", "Known after, ms", "Link", "Momentum: onset, s",
                "Known after, ms", "Link"});
  const auto same = same_contacts(summary);
  const auto cells = [&](const nlohmann::json& contact) {
    table.text(fmt::format("{:.2f}", contact.at("onset_s").get<double>()));
    table.text(fmt::format("{:.0f}", 1e3 * (contact.at("alarm_s").get<double>() -
                                            contact.at("onset_s").get<double>())));
    table.text(contact.at("link").get<std::string>());
  };
  const auto none = [&] {
    for (int k = 0; k < 3; ++k) table.text("-");
  };
  const nlohmann::json& theirs = document.at("momentum").at("contacts");
  std::vector<char> matched(theirs.size(), 0);
  for (std::size_t k = 0; k < same.size(); ++k) {
    const nlohmann::json& own = document.at("contacts")[k];
    table.begin_row();
    table.text(own.at("trajectory").get<std::string>());
    cells(own);
    if (!same[k]) {
      none();
      continue;
    }
    matched[*same[k]] = 1;
    cells(theirs[*same[k]]);
  }
  for (std::size_t m = 0; m < matched.size(); ++m) {
    if (matched[m] != 0) continue;
    table.begin_row();
    table.text(theirs[m].at("trajectory").get<std::string>());
    none();
    cells(theirs[m]);
  }
  return out + table.str() + "</section>\n";
}

// Broken where another trajectory begins.
std::vector<Eigen::Vector2d> broken(const std::vector<Eigen::Vector2d>& points,
                                    const std::vector<double>& begins_s) {
  std::vector<Eigen::Vector2d> out;
  auto begin = begins_s.begin();
  for (const Eigen::Vector2d& point : points) {
    const auto next = std::upper_bound(begin, begins_s.end(), point.x());
    if (next != begin && !out.empty()) {
      constexpr double kBreak = std::numeric_limits<double>::quiet_NaN();
      out.emplace_back(point.x(), kBreak);
    }
    begin = next;
    out.push_back(point);
  }
  return out;
}

// External torque of one joint over time; contacts as bands.
std::string joint_plot(const ContactSummary& summary, Eigen::Index joint) {
  const Eigen::Index samples = summary.t_s.size();
  const Eigen::Index step =
      std::max<Eigen::Index>(1, (samples + kMostContactPoints - 1) / kMostContactPoints);
  std::vector<Eigen::Vector2d> points;
  double low = 0.0;
  double high = 0.0;
  for (Eigen::Index i = 0; i < samples; i += step) {
    // The largest of each piece, so that short contacts stay visible.
    Eigen::Index peak = i;
    for (Eigen::Index k = i; k < std::min(samples, i + step); ++k) {
      if (std::abs(summary.external_torque(joint, k)) >
          std::abs(summary.external_torque(joint, peak))) {
        peak = k;
      }
    }
    points.emplace_back(summary.t_s[peak], summary.external_torque(joint, peak));
    low = std::min(low, points.back().y());
    high = std::max(high, points.back().y());
  }
  pad_range(low, high, 0.1);
  double begin = summary.t_s[0];
  double end = summary.t_s[samples - 1];
  pad_range(begin, end, 0.01);
  const std::string& name = summary.joints[static_cast<std::size_t>(joint)];
  const std::string unit =
      joint_unit(summary.torque_unit, summary.types[static_cast<std::size_t>(joint)]);
  Plot plot(fmt::format("External torque of {}", name),
            {.label = "time, s", .lower = begin, .upper = end},
            {.label = fmt::format("{}, {}", name, unit), .lower = low, .upper = high},
            {.width = 940.0, .height = 150.0});
  for (const ContactEvent& event : summary.events) {
    plot.band({event.onset_s, event.end_s}, {low, low}, {high, high}, series_class(1));
  }
  plot.line(broken(points, summary.clock.clock.begins_s()), series_class(0));
  return figure(plot.str(), "", "wide");
}

// Where each trajectory lies on the time line.
std::string where_trajectories_lie(const LogClock& log) {
  const std::vector<double> begins_s = log.clock.begins_s();
  if (begins_s.size() < 2) return "";
  constexpr std::size_t kMostNamed = 12;
  std::string out =
      log.clock.moved() ? "The trajectories lie one behind the other: " : "The trajectories: ";
  for (std::size_t k = 0; k < std::min(begins_s.size(), kMostNamed); ++k) {
    out += fmt::format("{}{} from {:.1f} s", k > 0 ? ", " : "", log.trajectory(begins_s[k]),
                       begins_s[k]);
  }
  if (begins_s.size() > kMostNamed)
    out += fmt::format(" and {} more", begins_s.size() - kMostNamed);
  return paragraph(out + ". The table's times are on the clock of each.");
}

std::string timeline(const ContactSummary& summary) {
  std::string out = section_head("timeline", "Contact time line");
  if (summary.t_s.size() < 2) return out + "</section>\n";
  out += paragraph(
      "External torque as a momentum observer (25 per s) follows it; the bands are the contacts "
      "found, from onset to end.");
  out += where_trajectories_lie(summary.clock);
  for (Eigen::Index j = 0; j < summary.external_torque.rows(); ++j) out += joint_plot(summary, j);
  return out + "</section>\n";
}

std::string calibration_section(const ContactSummary& summary, const nlohmann::json& document) {
  std::string out = section_head("calibration", "Noise and thresholds");
  const FalseAlarmCheck& check = summary.check;
  out += paragraph(fmt::format(
      "Noise and thresholds were learned from {} ({:.1f} s of free motion; {} spans that look like "
      "contacts were left out). {}: {}. Declared: {:g} false alarms an hour; "
      "outside the contacts found, the tail of the statistic promises {:.2g} an hour.",
      summary.learned, summary.calibration.exposure_s, summary.calibration.excluded.size(),
      summary.momentum ? "Expected torque" : "Masses and friction", summary.model,
      summary.calibration.options.false_alarms_per_hour, check.extrapolated_per_hour));
  Table table("noise-table", "Noise without contact", document);
  const std::string unit = common_unit(summary.torque_unit, summary.types);
  table.header({"Joint", "Velocity, per s", fmt::format("Torque, {}", unit),
                fmt::format("Model, {}", unit), "Model, correlation time, s"});
  for (std::size_t j = 0; j < summary.joints.size(); ++j) {
    table.begin_row();
    table.text(summary.joints[j]);
    for (const char* key : {"velocity_sigma", "torque_sigma", "model_sigma", "model_time_s"}) {
      table.number(fmt::format("/calibration/noise/{}/{}", key, j), Quantity::kPlain);
    }
  }
  out += table.str();
  for (const std::string& words : summary.new_motion) out += paragraph(words + ".", "note");
  for (const LogFinding& finding : summary.findings) out += paragraph(to_line(finding), "note");
  return out + "</section>\n";
}

}  // namespace
}  // namespace kinescope::report

namespace kinescope {

std::string contact_report_html(const ContactSummary& summary) {
  using namespace report;
  const nlohmann::json document = contact_json(summary);
  return page_begin("contact report", summary.robot, summary.log, summary.version,
                    contents(summary)) +
         "<main>\n" + section_head("verdict", "Verdict") + paragraph(contact_verdict(summary)) +
         contact_table(summary, document) + "</section>\n" + timeline(summary) +
         comparison(summary, document) + calibration_section(summary, document) +
         reproduction_section({.command = summary.command, .inputs = summary.inputs}) +
         "</main>\n</body>\n</html>\n";
}

}  // namespace kinescope
