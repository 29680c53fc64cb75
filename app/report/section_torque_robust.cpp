// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/sections.h"
#include "app/report/torque_sections.h"
#include "app/report/torque_unit.h"

namespace kinescope::report {
namespace {

std::string_view method_name(std::size_t method) {
  constexpr std::array<std::string_view, kRobustMethods.size()> kNames = {
      "all samples, normal noise", "worst tenth left out", "Student's t"};
  return kNames[method];
}

std::string method_table(const TorqueFacts& facts, const RobustSummary& robust) {
  Table table("robust-table",
              "nMSE on the held-out part, %; and how much of it the 95 % band holds, %",
              facts.result);
  std::vector<std::string> head{"Regression", ""};
  head.insert(head.end(), facts.summary.joints.begin(), facts.summary.joints.end());
  table.header(head);
  for (std::size_t m = 0; m < robust.scores.size(); ++m) {
    for (const bool coverage : {false, true}) {
      table.begin_row();
      table.text(coverage ? "" : method_name(m));
      table.text(coverage ? "held" : "nMSE");
      for (std::size_t j = 0; j < facts.summary.joints.size(); ++j) {
        table.number(fmt::format("/robust/methods/{}/{}/{}", m,
                                 coverage ? "coverage_95" : "nmse_percent", j),
                     coverage ? Quantity::kPercent : Quantity::kPlain);
      }
    }
  }
  return table.str();
}

std::string joint_table(const TorqueFacts& facts) {
  Table table("robust-joints-table",
              fmt::format("What cross-validation chose, and the parts of the torque (rms, {})",
                          facts.summary.train.torque_unit),
              facts.result);
  table.header({"Joint", "Bandwidth q", "dq", "ddq", "Beyond the rigid body", "Noise",
                "Low weight, %", "Friction", "Gravity", "Inertia"});
  for (std::size_t j = 0; j < facts.summary.joints.size(); ++j) {
    const std::string at = fmt::format("/robust/joints/{}/", j);
    table.begin_row();
    table.text(facts.summary.joints[j]);
    for (int k = 0; k < 3; ++k) {
      table.number(fmt::format("{}bandwidth/{}", at, k), Quantity::kPlain);
    }
    table.number(at + "beyond", Quantity::kPlain);
    table.number(at + "noise", Quantity::kPlain);
    table.number(at + "down_weighted", Quantity::kPercent);
    for (const char* part : {"friction_rms", "gravity_rms", "inertia_rms"}) {
      table.number(at + part, Quantity::kPlain);
    }
  }
  return table.str();
}

std::string friction_caption(const TorqueSummary& summary, const RobustSummary& robust,
                             std::size_t joint) {
  const double friction = robust.parts[joint].friction_rms;
  const auto column = summary.train.torque.col(static_cast<Eigen::Index>(joint));
  const double torque = column.norm() / std::sqrt(static_cast<double>(column.size()));
  return fmt::format("{}: {:.2g} {} rms, {:.2g} % of its torque{}.", summary.joints[joint],
                     friction, joint_unit(summary.train.torque_unit, summary.types[joint]),
                     100.0 * friction / torque,
                     friction < robust.joints[joint].noise ? ": below its noise" : "");
}

std::string profile_plot(const TorqueSummary& summary, const RobustSummary& robust,
                         std::size_t joint) {
  const std::vector<FrictionBin>& bins = robust.parts[joint].profile;
  if (bins.size() < 2) return "";
  std::vector<double> velocity;
  std::vector<double> lower;
  std::vector<double> upper;
  std::vector<Eigen::Vector2d> means;
  for (const FrictionBin& bin : bins) {
    velocity.push_back(bin.velocity);
    lower.push_back(bin.friction - bin.spread);
    upper.push_back(bin.friction + bin.spread);
    means.emplace_back(bin.velocity, bin.friction);
  }
  double low = *std::ranges::min_element(lower);
  double high = *std::ranges::max_element(upper);
  pad_range(low, high, 0.1);
  double left = velocity.front();
  double right = velocity.back();
  pad_range(left, right);
  const JointType type = summary.types[joint];
  const bool turns = type != JointType::kPrismatic;
  const std::string& name = summary.joints[joint];
  Plot plot(fmt::format("Learned friction of {}", name),
            {.label = turns ? "velocity, rad/s" : "velocity, m/s", .lower = left, .upper = right},
            {.label = fmt::format("{}, {}", name, joint_unit(summary.train.torque_unit, type)),
             .lower = low,
             .upper = high});
  plot.band(velocity, lower, upper, series_class(2));
  plot.line(means, series_class(2));
  plot.legend("part that turns round with the velocity", series_class(2));
  return figure(plot.str(), friction_caption(summary, robust, joint));
}

std::string mass_text(const PayloadEstimate& found) {
  return value_and_uncertainty(found.mass_kg, student_point(found.freedom) * found.sigma_kg,
                               Quantity::kPlain);
}

void estimate_row(Table& table, std::string_view name, const PayloadEstimate& found) {
  table.begin_row();
  table.text(name);
  table.text(mass_text(found));
  table.text(fmt::format("{:.4g} to {:.4g}", found.lower_kg, found.upper_kg));
  for (int k = 0; k < 3; ++k) {
    table.text(value_and_uncertainty(found.centre_m[k],
                                     student_point(found.freedom) * found.centre_sigma_m[k],
                                     Quantity::kLength));
  }
}

}  // namespace

std::string torque_robust_section(const TorqueFacts& facts) {
  if (!facts.summary.robust) return "";
  const RobustSummary& robust = *facts.summary.robust;
  std::string out = section_head("robust", "Robust regression");
  out += paragraph(fmt::format(
      "Each joint's torque as rigid body and drive plus a smooth function of (q, dq, ddq), learned "
      "from {} samples three ways: all samples with normal noise; the worst tenth of a "
      "wide-bandwidth fit left out; and noise of Student's t, which needs no share to be chosen. "
      "Bandwidths (in standard deviations of each signal) and noise by {}-fold cross-validation "
      "over {}. Where the three agree, no bad samples bend the result.",
      robust.scores.empty() ? 0 : robust.scores.front().training_samples, robust.folds,
      robust.by_trajectory ? "whole trajectories" : "stretches of the one trajectory"));
  out += method_table(facts, robust);
  out += paragraph(
      "Parts of the learned torque F, by Student's t, at zero acceleration: friction is what turns "
      "round with the velocity, (F(q, dq) - F(q, -dq)) / 2; gravity what does not, with offsets "
      "and centrifugal torque, (F(q, dq) + F(q, -dq)) / 2; inertia is what the acceleration adds. "
      "The curves show friction over each joint's own velocity; the band is its spread at one "
      "velocity: what else it depends on.");
  out += joint_table(facts);
  out += "<div class=\"figures\">";
  for (std::size_t j = 0; j < facts.summary.joints.size(); ++j) {
    out += profile_plot(facts.summary, robust, j);
  }
  return out + "</div>\n</section>\n";
}

std::string torque_payload_section(const TorqueFacts& facts) {
  if (!facts.summary.payload) return "";
  const PayloadSummary& payload = *facts.summary.payload;
  std::string out = section_head("payload", "Payload");
  out += paragraph(torque_verdict(facts.summary).payload);
  Table table("payload-table",
              fmt::format("What {} carries more than {}", payload.motion.link, payload.against),
              facts.result);
  table.header(
      {"From", "Mass, kg (± 95 %)", "95 % interval, kg", "Centre x, mm", "y, mm", "z, mm"});
  estimate_row(table, "all of the motion", payload.motion);
  if (payload.at_rest) estimate_row(table, "the learned torque at rest", *payload.at_rest);
  out += table.str();
  out += paragraph(fmt::format("The centre is in the frame of {}.", payload.motion.link), "note");
  Table joints("payload-joints-table", "The mass that each joint's torque alone would say",
               facts.result);
  joints.header({"Joint", "Mass, kg", "Standard deviation, kg"});
  for (std::size_t k = 0; k < payload.motion.joints.size(); ++k) {
    const std::string at = fmt::format("/payload/motion/joints/{}/", k);
    joints.begin_row();
    joints.text(facts.summary.joints[static_cast<std::size_t>(payload.motion.joints[k].joint)]);
    joints.number(at + "mass_kg", Quantity::kPlain);
    joints.number(at + "sigma_kg", Quantity::kPlain);
  }
  return out + joints.str() + "</section>\n";
}

}  // namespace kinescope::report
