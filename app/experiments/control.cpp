// SPDX-License-Identifier: Apache-2.0
//
// Learned compensation in the servo loop of a WAM: seven joints on unseen trajectories, and joint 4
// alone as in Dang's report.
#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/experiments/experiments.h"
#include "app/report/experiment_plots.h"
#include "dynamics/experiments/barrett_control.h"
#include "dynamics/experiments/wam_control.h"
#include "kinematics/core/error.h"

namespace kinescope::experiments {
namespace {

using report::Curve;
using Figure = ExperimentSection::Figure;

constexpr Eigen::Index kShownPoints = 600;  // of a curve

const char* load_of(const WamRow& row) { return row.loaded ? "carried" : "none"; }

std::size_t worst_of(const WamRow& row) {
  Eigen::Index worst = 0;
  row.error_rad.maxCoeff(&worst);
  return static_cast<std::size_t>(worst);
}

/// PD with nominal gravity under the same load.
const WamRow& baseline_of(const WamControlResult& wam, bool loaded) {
  const auto found = std::ranges::find(wam.rows, loaded, &WamRow::loaded);
  KINESCOPE_CHECK(found != wam.rows.end(), "runs of both loads");
  return *found;
}

ExperimentTable errors_table(const WamControlResult& wam) {
  ExperimentTable out{"wam",
                      "Root mean square tracking error on unseen trajectories, rad",
                      {"Controller", "Payload", "Worst joint"},
                      wam.joints,
                      {}};
  out.values.emplace_back("least reduction");
  for (const WamRow& row : wam.rows) {
    std::vector<double> values(row.error_rad.data(), row.error_rad.data() + row.error_rad.size());
    const Eigen::VectorXd& before = baseline_of(wam, row.loaded).error_rad;
    values.push_back(before.cwiseQuotient(row.error_rad).minCoeff());
    out.rows.push_back({{row.controller, load_of(row), wam.joints[worst_of(row)]}, values});
  }
  return out;
}

ExperimentTable joint_table(const WamControlResult& wam, std::string id, std::string caption,
                            Eigen::VectorXd WamRow::* values) {
  ExperimentTable out{std::move(id), std::move(caption), {"Controller", "Payload"}, wam.joints, {}};
  for (const WamRow& row : wam.rows) {
    const Eigen::VectorXd& own = row.*values;
    out.rows.push_back(
        {{row.controller, load_of(row)}, std::vector<double>(own.data(), own.data() + own.size())});
  }
  return out;
}

ExperimentTable payload_table(const WamControlResult& wam, double true_kg) {
  const PayloadEstimate& own = wam.payload;
  return {"payload",
          "Load identified from the logs with and without it, kg; centre in the last link's frame, "
          "m",
          {},
          {"true", "mass", "from", "to", "x", "y", "z"},
          {{{},
            {true_kg, own.mass_kg, own.lower_kg, own.upper_kg, own.centre_m.x(), own.centre_m.y(),
             own.centre_m.z()}}}};
}

ExperimentTable joint_four_table(const BarrettControlResult& joint) {
  ExperimentTable out{
      "joint4",
      "Joint 4 alone: tracking error on the sinusoid that was not learned, from its "
      "second period on, rad",
      {"Controller"},
      {"rms", "largest", "share of the feedback", "weight of the learned part"},
      {}};
  for (const BarrettControlRow& row : joint.rows) {
    out.rows.push_back(
        {{row.controller}, {row.error_rad, row.largest_rad, row.feedback_share, row.weight}});
  }
  return out;
}

Curve over_time(const Eigen::VectorXd& t_s, const Eigen::VectorXd& values, std::string name) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}};
  const Eigen::Index step = 1 + (t_s.size() - 1) / kShownPoints;
  for (Eigen::Index i = 0; i < t_s.size(); i += step) out.points.emplace_back(t_s[i], values[i]);
  return out;
}

Figure wam_figure(const WamControlResult& wam) {
  const std::size_t joint = worst_of(wam.rows.front());
  std::vector<Curve> curves;
  for (const WamTrace& trace : wam.traces) {
    curves.push_back(over_time(trace.t_s, trace.error_rad.col(static_cast<Eigen::Index>(joint)),
                               trace.controller));
  }
  return {report::curve_plot("Tracking error of the WAM", {.label = "time, s"},
                             {.label = fmt::format("error of {}, rad", wam.joints[joint])}, curves),
          "The worst joint of PD with nominal gravity on the first unseen trajectory"};
}

std::vector<Figure> joint_four_figures(const BarrettControlResult& joint) {
  std::vector<Curve> motion{over_time(joint.t_s, joint.reference_rad, "desired")};
  std::vector<Curve> errors;
  for (const BarrettControlRow& row : joint.rows) {
    motion.push_back(over_time(joint.t_s, row.q_rad, row.controller));
    errors.push_back(over_time(joint.t_s, row.q_rad - joint.reference_rad, row.controller));
  }
  return {{report::curve_plot("Joint 4 over time", {.label = "time, s"}, {.label = "joint 4, rad"},
                              motion),
           "Desired motion, without and with compensation (figure 9 of the report)"},
          {report::curve_plot("Error of joint 4 over time", {.label = "time, s"},
                              {.label = "error, rad"}, errors),
           "The same as tracking errors"}};
}

/// "feed-forward, traced effects: 0.0067 rad rms at its worst joint, joint7; least reduction 11.8
/// times, at joint7."
std::string wam_words(const WamControlResult& wam, const WamRow& row) {
  const WamRow& before = baseline_of(wam, row.loaded);
  Eigen::Index least = 0;
  const double ratio = before.error_rad.cwiseQuotient(row.error_rad).minCoeff(&least);
  std::string out = fmt::format("{}{}: {:.4f} rad rms at its worst joint, {}", row.controller,
                                row.loaded ? ", loaded" : "", row.error_rad.maxCoeff(),
                                wam.joints[worst_of(row)]);
  if (&row != &before) {
    out += fmt::format("; least reduction {:.3g} times, at {}", ratio,
                       wam.joints[static_cast<std::size_t>(least)]);
  }
  return out + ".";
}

std::vector<std::string> findings_of(const WamControlResult& wam, const BarrettControlResult& joint,
                                     double true_kg) {
  std::vector<std::string> out;
  for (const WamRow& row : wam.rows) out.push_back(wam_words(wam, row));
  out.push_back(fmt::format("The load of {:g} kg is identified as {:.4f} kg ({:.4f} to {:.4f}).",
                            true_kg, wam.payload.mass_kg, wam.payload.lower_kg,
                            wam.payload.upper_kg));
  const BarrettControlRow& before = joint.rows.front();
  const auto best = std::ranges::min_element(joint.rows, {}, &BarrettControlRow::error_rad);
  out.push_back(fmt::format(
      "Joint 4 alone on the unseen sinusoid: {:.4f} rad rms ({:.4f} at most) before, {:.4f} "
      "({:.4f}) with {} (published, on the real arm: 0.06 to 0.005 rad).",
      before.error_rad, before.largest_rad, best->error_rad, best->largest_rad, best->controller));
  return out;
}

std::vector<ExperimentSection> sections_of(const WamControlResult& wam,
                                           const BarrettControlResult& joint) {
  std::vector<ExperimentSection> out;
  out.push_back(
      {"wam-arm",
       "Seven joints",
       {"A WAM-like arm whose joints have Coulomb, viscous, Stribeck, load-dependent and "
        "pre-sliding "
        "friction; its controller knows masses that are wrong, no sensor at the wrist and no "
        "friction. All models learn from one log under PD with nominal gravity; all controllers "
        "have the same gains, encoders and limits.",
        fmt::format("Traced: {}.", fmt::join(wam.effects, ", "))},
       {"wam", "feedback", "weight", "payload"},
       {wam_figure(wam)}});
  out.push_back({"joint-four",
                 "Joint 4 alone",
                 {"Learned on one sinusoid, compensated on another; all other joints are held. The "
                  "gains are such that PD errs as the report's robot did.",
                  fmt::format("Traced: {}.", fmt::join(joint.effects, ", "))},
                 {"joint4"},
                 joint_four_figures(joint)});
  return out;
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary control_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  WamControlOptions options{.seed = choice.seed};
  if (choice.joints) {
    // Below the elbow no joint turns a load about two horizontal axes, and its mass does not show.
    constexpr int kFewestJoints = 4;
    if (choice.joints->size() != 1 || choice.joints->front() < kFewestJoints) {
      throw bad_request("--joints", "the WAM takes one number, and its load shows from joint 4 on",
                        "give 4 to 7");
    }
    options.joints = choice.joints->front();
  }
  options.tests = choice.runs.value_or(options.tests);
  options.learn_s = choice.seconds.value_or(options.learn_s);
  options.test_s = std::min(options.test_s, options.learn_s);
  BarrettControlOptions joint_options;
  joint_options.robot.seed = choice.seed;
  const BarrettControlResult joint = run_barrett_control(joint_options, choice.threads, progress);
  const WamControlResult wam = run_wam_control(options, choice.threads, progress);
  ExperimentSummary out;
  out.settings = {
      {"Seed", fmt::format("{}", choice.seed)},
      {"Log", fmt::format("{:g} s", options.learn_s)},
      {"Unseen trajectories", fmt::format("{} of {:g} s", options.tests, options.test_s)},
      {"Servo", fmt::format("{:g} Hz, bandwidth {:g} Hz, velocities by differences "
                            "through a low-pass of {:g} Hz, encoder steps of {:g} rad",
                            options.rate_hz, options.bandwidth_hz, options.velocity_cutoff_hz,
                            options.encoder_step_rad)},
      {"Joint 4", fmt::format("learned at {:g} rad/s, compensated at {:g} rad/s, "
                              "bandwidth {:g} Hz",
                              joint_options.learned.rate_rad_s,
                              joint_options.compensated.rate_rad_s, joint_options.bandwidth_hz)}};
  out.findings = findings_of(wam, joint, options.payload_kg);
  out.tables = {errors_table(wam),
                joint_table(wam, "feedback",
                            "Share of the feedback: rms of its torque over that of the command",
                            &WamRow::feedback_share),
                joint_table(wam, "weight", "Mean weight of what was learned", &WamRow::weight),
                payload_table(wam, options.payload_kg), joint_four_table(joint)};
  out.sections = sections_of(wam, joint);
  return out;
}

}  // namespace kinescope
