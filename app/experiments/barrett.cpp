// SPDX-License-Identifier: Apache-2.0
//
// Joint 4 of a WAM with a sensor at its wrist: outliers, cross-validation, friction, gravity, mass.
#include "dynamics/experiments/barrett.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "app/experiments/experiments.h"
#include "app/report/experiment_plots.h"

namespace kinescope::experiments {
namespace {

using report::Curve;
using Figure = ExperimentSection::Figure;

constexpr int kShownMotion = 1;  // of wam_motions(): in the middle of the amplitudes

// Over the position, in the order of time.
Curve over_position(const BarrettResult& result, const Eigen::VectorXd& torque, std::string name,
                    bool dots) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}, .dots = dots};
  const TorqueSamples& log = result.log.measured;
  for (Eigen::Index i = 0; i < log.size(); ++i) {
    if (log.trajectory[i] == kShownMotion) out.points.emplace_back(log.q(i, 0), torque[i]);
  }
  return out;
}

Figure of_fits(const BarrettResult& result, std::string_view name,
               const std::vector<std::string>& fits, std::string caption) {
  std::vector<Curve> curves{over_position(result, result.log.measured.torque, "measured", true),
                            over_position(result, result.log.clean, "truth", false)};
  for (const BarrettFit& fit : result.fits) {
    if (std::ranges::find(fits, fit.name) == fits.end()) continue;
    curves.push_back(over_position(result, fit.at_log, fit.name, false));
  }
  return {report::curve_plot(name, {.label = "joint 4, rad"}, {.label = "torque, N m"}, curves),
          std::move(caption)};
}

// The least error at each length scale of the velocity.
Curve along_speed(const std::vector<GridPoint>& grid, double GridPoint::* error, std::string name) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}};
  for (const GridPoint& point : grid) {
    if (out.points.empty() || out.points.back().x() != point.speed) {
      out.points.emplace_back(point.speed, point.*error);
    }
    out.points.back().y() = std::min(out.points.back().y(), point.*error);
  }
  return out;
}

Figure of_grid(const BarrettResult& result) {
  return {report::curve_plot(
              "Left-out error over the length scale",
              {.label = "length scale of the velocity, standard deviations", .log10 = true},
              {.label = "left-out rms, N m"},
              {along_speed(result.grid, &GridPoint::chunk_rms, "ten random chunks"),
               along_speed(result.grid, &GridPoint::block_rms, "ten blocks")}),
          "Cross-validation over the grid: the least over the other length scale and the noise"};
}

template <typename Point>
Curve curve_of(const std::vector<Point>& points, double Point::* x, double Point::* y,
               std::string name, bool dots = false) {
  Curve out{.name = std::move(name), .points = {}, .lower = {}, .upper = {}, .dots = dots};
  for (const Point& point : points) out.points.emplace_back(point.*x, point.*y);
  return out;
}

Figure of_friction(const BarrettResult& result) {
  return {report::curve_plot(
              "Friction over the velocity", {.label = "joint 4, rad/s"}, {.label = "friction, N m"},
              {curve_of(result.friction, &FrictionPoint::dq, &FrictionPoint::friction, "learned"),
               curve_of(result.friction, &FrictionPoint::dq, &FrictionPoint::truth, "truth")}),
          "(F(q, dq) - F(q, -dq)) / 2 at the middle posture and zero acceleration"};
}

Figure of_gravity(const BarrettResult& result) {
  const auto curve = [&](double GravityPoint::* y, std::string name) {
    return curve_of(result.gravity, &GravityPoint::q, y, std::move(name));
  };
  return {report::curve_plot(
              "Even part over the position", {.label = "joint 4, rad"}, {.label = "F_m, N m"},
              {curve(&GravityPoint::even, "learned"), curve(&GravityPoint::truth, "truth"),
               curve(&GravityPoint::without_sensor, "model without the sensor")}),
          fmt::format("F_m(q) = (F(q, dq) + F(q, -dq)) / 2 at dq = {:g} rad/s and zero "
                      "acceleration",
                      result.gravity_dq)};
}

std::vector<ExperimentTable> tables_of(const BarrettResult& result) {
  ExperimentTable fits{"fits",
                       "Root mean square errors, N m: of what was fitted, left out one by one, and "
                       "of a motion that was not learned (against its torque without noise)",
                       {"Fit"},
                       {"samples", "in sample", "left out", "unseen motion"},
                       {}};
  for (const BarrettFit& fit : result.fits) {
    fits.rows.push_back(
        {{fit.name},
         {static_cast<double>(fit.samples), fit.in_sample_rms, fit.left_out_rms, fit.unseen_rms}});
  }
  ExperimentTable grid{
      "grid",
      "Root mean square errors left out in random chunks and in blocks, N m",
      {},
      {"length scale", "of the velocity", "noise", "ten random chunks", "ten blocks"},
      {}};
  for (const GridPoint& point : result.grid) {
    grid.rows.push_back(
        {{}, {point.length, point.speed, point.noise, point.chunk_rms, point.block_rms}});
  }
  ExperimentTable choices{"choices",
                          "What each cross-validation chooses, and what its errors say, N m",
                          {"Folds"},
                          {"length scale", "of the velocity", "noise", "claimed", "unseen motion"},
                          {}};
  for (const auto& [name, choice] : {std::pair{"ten random chunks", &result.by_chunks},
                                     std::pair{"ten blocks", &result.by_blocks}}) {
    choices.rows.push_back({{name},
                            {choice->point.length, choice->point.speed, choice->point.noise,
                             choice->claimed_rms, choice->unseen_rms}});
  }
  ExperimentTable friction{"friction",
                           "Friction of joint 4",
                           {},
                           {"velocity (rad/s)", "learned (N m)", "truth (N m)"},
                           {}};
  for (const FrictionPoint& point : result.friction) {
    friction.rows.push_back({{}, {point.dq, point.friction, point.truth}});
  }
  ExperimentTable gravity{
      "gravity",
      "The part of joint 4's torque that is even in its velocity",
      {},
      {"position (rad)", "learned (N m)", "truth (N m)", "model without the sensor (N m)"},
      {}};
  for (const GravityPoint& point : result.gravity) {
    gravity.rows.push_back({{}, {point.q, point.even, point.truth, point.without_sensor}});
  }
  const SensorMass& mass = result.sensor;
  ExperimentTable sensor{"sensor",
                         "Mass of the sensor, from the even part, kg",
                         {},
                         {"mass", "standard uncertainty", "from", "to"},
                         {{{}, {mass.kg, mass.sigma_kg, mass.lower_kg, mass.upper_kg}}}};
  return {fits, grid, choices, friction, gravity, sensor};
}

std::vector<std::string> findings_of(const BarrettResult& result, const BarrettOptions& options) {
  const BarrettFit& all = result.fits[0];
  const BarrettFit& trimmed = result.fits[1];
  const SensorMass& mass = result.sensor;
  return {
      fmt::format("Sensor of {:g} kg: {:.4f} kg, 95 % interval {:.4f} to {:.4f} (published, on the "
                  "real arm: 0.254 ± 0.009).",
                  options.sensor_kg, mass.kg, mass.lower_kg, mass.upper_kg),
      fmt::format("Taking the worst tenth out: {} of {} outliers are in it; in-sample error {:.3f} "
                  "to {:.3f} N m, which falls already because the worst are not counted; on a "
                  "motion that was not learned, {:.3f} to {:.3f} N m.",
                  result.removed_wrong, result.log.wrong.size(), all.in_sample_rms,
                  trimmed.in_sample_rms, all.unseen_rms, trimmed.unseen_rms),
      fmt::format("Ten random chunks choose length scales {:g} and {:g} (velocity), and claim an "
                  "error of {:.3f} N m where blocks of the same samples say {:.3f}; ten blocks "
                  "choose {:g} and {:g}. On the unseen motion the one errs by {:.3f} N m, the "
                  "other by {:.3f}.",
                  result.by_chunks.point.length, result.by_chunks.point.speed,
                  result.by_chunks.claimed_rms, result.by_chunks.point.block_rms,
                  result.by_blocks.point.length, result.by_blocks.point.speed,
                  result.by_chunks.unseen_rms, result.by_blocks.unseen_rms),
      fmt::format("Unseen motion, with outliers in what was learned: support vectors {:.3f}, all "
                  "samples {:.3f}, worst tenth out {:.3f}, Student's t {:.3f} N m.",
                  result.fits[3].unseen_rms, all.unseen_rms, trimmed.unseen_rms,
                  result.fits[2].unseen_rms)};
}

std::vector<ExperimentSection> sections_of(const BarrettResult& result) {
  std::vector<ExperimentSection> out;
  out.push_back({"outliers",
                 "Outliers",
                 {"Joint 4 of a WAM-like arm moves as C1 + C2 sin(w t) while all others are held. "
                  "The in-sample error is the report's measure; it falls also because the worst "
                  "samples are not counted any more. Left out one by one and a motion that was not "
                  "learned say what was gained."},
                 {"fits"},
                 {of_fits(result, "All samples", {"all samples"},
                          "A Gaussian process of all samples, one of the motions"),
                  of_fits(result, "Worst tenth out", {"worst tenth out", "Student's t"},
                          "Without the worst tenth, and with Student's t in its place"),
                  of_fits(result, "Support vectors", {"support vectors", "all samples"},
                          "Support vectors beside a Gaussian process of all samples")}});
  out.push_back({"grid",
                 "Hyperparameters by cross-validation",
                 {"Ten random chunks leave neighbours in time on both sides, ten blocks do not."},
                 {"choices"},
                 {of_grid(result)}});
  out.push_back({"parts",
                 "Friction and gravity",
                 {"The learned torque without its worst tenth, split by the sign of the velocity. "
                  "The sensor's mass is what F_m holds beyond the gravity of the arm, whose masses "
                  "and the sensor's centre are known; the interval is a block jackknife's."},
                 {"sensor"},
                 {of_friction(result), of_gravity(result)}});
  return out;
}

}  // namespace
}  // namespace kinescope::experiments

namespace kinescope {

ExperimentSummary barrett_experiment(const ExperimentChoice& choice, const Progress& progress) {
  using namespace experiments;
  BarrettOptions options{.seed = choice.seed};
  options.samples = choice.samples.value_or(options.samples);
  const BarrettResult result = run_barrett(options, choice.threads, progress);
  ExperimentSummary out;
  out.settings = {
      {"Seed", fmt::format("{}", choice.seed)},
      {"Samples", fmt::format("{}", result.log.measured.size())},
      {"Noise", fmt::format("{:g} N m", options.noise_nm)},
      {"Outliers", fmt::format("{:g} % of the samples, off by up to {:g} N m",
                               100.0 * options.outlier_share, options.outlier_nm)},
      {"Friction", fmt::format("Coulomb {:g} N m, viscous {:g} N m s, {:g} N m more at low speed "
                               "({:g} rad/s)",
                               options.coulomb_nm, options.viscous_nms, options.breakaway_nm,
                               options.stribeck_rad_s)}};
  out.findings = findings_of(result, options);
  out.tables = tables_of(result);
  out.sections = sections_of(result);
  return out;
}

}  // namespace kinescope
