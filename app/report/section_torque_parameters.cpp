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

constexpr int kVelocityBins = 24;
constexpr std::size_t kMostListed = 120;
constexpr std::string_view kParameterNames =
    "m: mass; mcx, mcy, mcz: mass times the place of its centre; Ixx .. Izz: moments of inertia "
    "about "
    "the link's frame; motor_inertia: of rotor and gear, at the joint's side.";

// Of the parametric model, which the plots show; what tracing found beside it has its own.
double drive_value(const TorqueSummary& summary, std::string_view term, const std::string& joint) {
  const Identification& found = summary.identification;
  const std::string name = fmt::format("{}({})", term, joint);
  for (std::size_t k = 0; k < found.names.size(); ++k) {
    const bool alone = found.names[k] == name || found.names[k].starts_with(name + " ");
    if (alone) return found.parameters[static_cast<Eigen::Index>(k)];
  }
  return 0.0;
}

// What is left of the torque without the rigid body, over velocity: the friction as measured.
std::string friction_plot(const TorqueSummary& summary, Eigen::Index joint,
                          const Eigen::MatrixXd& rest) {
  const std::string& name = summary.joints[static_cast<std::size_t>(joint)];
  const double viscous = drive_value(summary, "viscous", name);
  const double coulomb = drive_value(summary, "coulomb", name);
  const auto dq = summary.train.dq.col(joint);
  const double fastest = std::max(dq.cwiseAbs().maxCoeff(), 1e-9);
  std::vector<double> sum(kVelocityBins, 0.0);
  std::vector<double> square(kVelocityBins, 0.0);
  std::vector<int> count(kVelocityBins, 0);
  for (Eigen::Index i = 0; i < dq.size(); ++i) {
    const int bin = std::clamp(static_cast<int>((dq[i] / fastest + 1.0) * 0.5 * kVelocityBins), 0,
                               kVelocityBins - 1);
    const double value = rest(i, joint) + viscous * dq[i] +
                         coulomb * (dq[i] > 0.0   ? 1.0
                                    : dq[i] < 0.0 ? -1.0
                                                  : 0.0);
    sum[static_cast<std::size_t>(bin)] += value;
    square[static_cast<std::size_t>(bin)] += value * value;
    ++count[static_cast<std::size_t>(bin)];
  }
  std::vector<Eigen::Vector2d> means;
  std::vector<Eigen::Vector2d> model;
  double low = 0.0;
  double high = 0.0;
  for (int b = 0; b < kVelocityBins; ++b) {
    const auto k = static_cast<std::size_t>(b);
    const double velocity = ((b + 0.5) / kVelocityBins * 2.0 - 1.0) * fastest;
    const double friction = viscous * velocity + std::copysign(coulomb, velocity);
    model.emplace_back(velocity, friction);
    low = std::min(low, friction);
    high = std::max(high, friction);
    if (count[k] < 3) continue;
    means.emplace_back(velocity, sum[k] / count[k]);
    low = std::min(low, means.back().y());
    high = std::max(high, means.back().y());
  }
  pad_range(low, high, 0.1);
  const JointType type = summary.types[static_cast<std::size_t>(joint)];
  const bool turns = type != JointType::kPrismatic;
  Plot plot(fmt::format("Friction of {}", name),
            {.label = turns ? "velocity, rad/s" : "velocity, m/s",
             .lower = -1.05 * fastest,
             .upper = 1.05 * fastest},
            {.label = fmt::format("{}, {}", name, joint_unit(summary.train.torque_unit, type)),
             .lower = low,
             .upper = high});
  plot.line(model, series_class(0));
  plot.dots(means, series_class(1));
  plot.legend("viscous and Coulomb", series_class(0));
  plot.legend("measured, mean of the bin", series_class(1));
  return figure(plot.str(), fmt::format("Friction profile of {}.", name));
}

// "motor_inertia" of "motor_inertia(joint2) + ..".
std::string_view first_name(std::string_view combination) {
  return combination.substr(0, combination.find('('));
}

// Of a parameter of a joint (drives) or of a link, by its first name. Slides count in m.
std::string parameter_unit(std::string_view name, const std::string& torque_unit, bool slides) {
  std::string torque =
      joint_unit(torque_unit, slides ? JointType::kPrismatic : JointType::kRevolute);
  if (name == "coulomb" || name == "offset") return torque;
  if (name == "viscous") return torque + (slides ? " s/m" : " s/rad");
  const bool mass = name == "m" || (name == "motor_inertia" && slides);
  const std::string inertia = mass ? "kg" : name.starts_with("mc") ? "kg m" : "kg m²";
  return torque_unit == "Nm" ? inertia : fmt::format("{} × {}/(N m)", inertia, torque);
}

bool is_slide(const TorqueSummary& summary, std::string_view joint) {
  const auto found = std::ranges::find(summary.joints, joint);
  return found != summary.joints.end() &&
         summary.types[static_cast<std::size_t>(found - summary.joints.begin())] ==
             JointType::kPrismatic;
}

// "joint2" of "motor_inertia(joint2) + ..".
std::string_view first_place(std::string_view combination) {
  const std::size_t open = combination.find('(');
  if (open == std::string_view::npos) return {};
  return combination.substr(open + 1, combination.find(')') - open - 1);
}

std::string drive_table(const TorqueFacts& facts) {
  Table table("drives-table",
              facts.summary.trace
                  ? "Drives (expanded uncertainty, k = 2); as traced where tracing sizes them"
                  : "Drives (expanded uncertainty, k = 2)",
              facts.result);
  table.header({"Joint", "Term", "Value", "U", "Unit"});
  for (std::size_t k = 0; k < facts.summary.drives.size(); ++k) {
    const DriveEstimate& estimate = facts.summary.drives[k];
    table.begin_row();
    table.text(estimate.joint);
    table.text(estimate.term);
    table.number(fmt::format("/drives/{}/value", k), Quantity::kPlain);
    table.text(std::isfinite(estimate.sigma) ? fmt::format("{:.2g}", 2.0 * estimate.sigma)
                                             : "not determined");
    table.text(parameter_unit(estimate.term, facts.summary.train.torque_unit,
                              is_slide(facts.summary, estimate.joint)));
  }
  return table.str();
}

std::string parameter_table(const TorqueFacts& facts) {
  Table table("parameters-table",
              facts.summary.trace
                  ? "Base parameters of the parametric model, without what tracing found"
                  : "Base parameters: all that this torque can tell",
              facts.result);
  table.header({"Combination of inertial parameters", "Value", "U (k = 2)", "Unit of the first"});
  const Identification& found = facts.summary.identification;
  const auto count = std::min<std::size_t>(kMostListed, found.names.size());
  for (std::size_t k = 0; k < count; ++k) {
    table.begin_row();
    table.text(found.names[k]);
    table.number(fmt::format("/parameters/{}/value", k), Quantity::kPlain);
    const double sigma = found.sigma_of(static_cast<Eigen::Index>(k));
    table.text(std::isfinite(sigma) ? fmt::format("{:.2g}", 2.0 * sigma) : "not determined");
    table.text(parameter_unit(first_name(found.names[k]), facts.summary.train.torque_unit,
                              is_slide(facts.summary, first_place(found.names[k]))));
  }
  return table.str();
}

}  // namespace

std::string torque_parameters_section(const TorqueFacts& facts) {
  const TorqueSummary& summary = facts.summary;
  std::string out = section_head("parameters", "Friction and parameters");
  const Eigen::MatrixXd rest =
      summary.train.torque -
      predict_torque(summary.identification, summary.train.q, summary.train.dq, summary.train.ddq)
          .mean;
  out += "<div class=\"columns\">";
  for (Eigen::Index j = 0; j < summary.train.joints(); ++j) out += friction_plot(summary, j, rest);
  return out + "</div>\n" + drive_table(facts) +
         folded_part("Base parameters: the combinations of masses that the torques tell apart",
                     parameter_table(facts) + paragraph(kParameterNames, "note")) +
         "</section>\n";
}

}  // namespace kinescope::report
