// SPDX-License-Identifier: Apache-2.0
//
// Verdict, identity, method, how to reproduce: the sections of words.
#include <algorithm>
#include <string>

#include <fmt/format.h>

#include "app/report/assets.h"
#include "app/report/findings.h"
#include "app/report/html.h"
#include "app/report/sections.h"
#include "app/report/trace_words.h"

namespace kinescope::report {
namespace {

/// One light: a word and a sign beside the colour, so that print and colour-blind readers have it
/// too.
std::string light(std::string_view subject, std::string_view css_class, std::string_view word,
                  std::string_view rule) {
  const std::string_view sign = css_class == "good" ? "✓" : css_class == "fair" ? "!" : "✗";
  return fmt::format(
      "<li class=\"light {}\"><span class=\"sign\">{}</span><b>{}</b> {}<small>{}</small></li>\n",
      css_class, sign, subject, escaped(word), escaped(rule));
}

std::string structure_light(const RunSummary& run) {
  if (!run.nominal_faults.empty()) {
    return light("Structure", "fair", "given and mended",
                 "what the nominal robot declares did not fit; see below what was taken instead");
  }
  if (!run.structure) {
    return light("Structure", "good", "given",
                 "the nominal robot declares it; nothing was decided");
  }
  const StructureStatus status = run.structure->status;
  const std::string_view css_class = status == StructureStatus::kDetermined  ? "good"
                                     : status == StructureStatus::kAmbiguous ? "fair"
                                                                             : "poor";
  return light("Structure", css_class, status_words(status),
               "determined: every joint has odds of at least 100 : 1 over its runner-up");
}

std::string geometry_light(const Facts& facts) {
  const RunSummary& run = facts.run;
  const Calibration& calibration = run.calibration;
  const double ratio = held_out_ratio(calibration);
  const std::string rule = fmt::format(
      "reliable: converged, the held-out error at most {} times the training error, and no more "
      "than "
      "{:.0f} % of the residual follows a joint or the time",
      kRatioLimit, 100.0 * kDependenceLimit);
  if (calibration.status != CalibrationStatus::kConverged) {
    return light("Geometry", "poor", status_words(calibration.status), rule);
  }
  if (ratio == 0.0) return light("Geometry", "fair", "not checked on unseen data", rule);
  if (ratio > kRatioLimit) {
    return light("Geometry", "fair", fmt::format("held out / training = {:.2f}", ratio), rule);
  }
  if (!facts.analysis.dependence.empty() &&
      facts.analysis.dependence.front().explained >= kDependenceLimit) {
    return light("Geometry", "fair",
                 fmt::format("the residual follows {}", facts.analysis.dependence.front().on),
                 rule);
  }
  return light("Geometry", "good", fmt::format("reliable (held out / training = {:.2f})", ratio),
               rule);
}

std::string_view trace_word(const Trace& trace) {
  switch (trace.verdict) {
    case TraceVerdict::kClean:
      return "noise, nothing else";
    case TraceVerdict::kEffects:
      return "traced to what the model lacked, corrected";
    case TraceVerdict::kAmbiguous:
      return "traced, but to one of several causes";
    case TraceVerdict::kUnknown:
      if (!trace.rest.empty()) return "structure left that no known effect explains";
      return std::ranges::any_of(trace.accepted, &TracedEffect::is_curve)
                 ? "repeats with joints' values, cause unknown, corrected"
                 : "what is left lasts, cause unknown";
    case TraceVerdict::kNothingToSay:
    case TraceVerdict::kNotRun:
      break;
  }
  return "not traced: too little to tell";
}

std::string residual_light(const Trace& trace, double sigma_scale) {
  const std::string rule = fmt::format(
      "searched for known effects of camera, encoders and joints; of 100 recordings with noise "
      "alone "
      "{:.0f} would be told one",
      100.0 * trace.false_alarm_rate);
  if (trace.verdict != TraceVerdict::kClean)
    return light("Residual", "fair", trace_word(trace), rule);
  if (sigma_scale > kNoiseLimit) {
    return light(
        "Residual", "fair",
        fmt::format("nothing known is left, but {:.1f} times the expected noise", sigma_scale),
        rule);
  }
  return light("Residual", "good", trace_word(trace), rule);
}

std::string verdict_line(std::string_view label, std::string_view words) {
  return fmt::format("<dt>{}</dt><dd>{}</dd>\n", label, with_code(words));
}

}  // namespace

std::string section_head(std::string_view id, std::string_view title) {
  return fmt::format("<section id=\"{}\"><h2>{}</h2>\n", id, escaped(title));
}

std::string verdict_section(const Facts& facts) {
  const auto& trace = facts.run.trace;
  const bool traced = trace && trace->verdict != TraceVerdict::kNotRun;
  const std::string lights =
      "<ul class=\"lights\">\n" + structure_light(facts.run) + geometry_light(facts) +
      (traced ? residual_light(*trace, facts.run.calibration.sigma_scale) : "") + "</ul>\n";
  std::string out = section_head("verdict", "Verdict") + first_screen(facts, lights);
  out += "<dl class=\"verdict\">\n";
  out += verdict_line("Found", facts.verdict.found);
  out += verdict_line("Accuracy", facts.verdict.accurate);
  if (traced) out += verdict_line("What the model lacked", trace_paragraph(*trace));
  out += verdict_line("What limits it", facts.verdict.limits);
  return out + "</dl></section>\n";
}

std::string identity_section(const Facts& facts) {
  const RunSummary& run = facts.run;
  std::string out = section_head("identity", "Identity");
  Table table("identity-table", "This run", facts.result);
  const auto row = [&](std::string_view name, const std::string& value) {
    table.begin_row();
    table.text(name);
    table.text(value);
  };
  row("Robot", run.robot);
  row("Recording", fmt::format("{} (entered as {})", run.recording, run.entry));
  row("Kinescope", run.version);
  row("Command", run.command);
  out += "<div class=\"columns\">" + table.str();
  Table inputs("inputs-table", "Input files", facts.result);
  inputs.header({"File", "SHA-256"});
  for (const InputFile& input : run.inputs) {
    inputs.begin_row();
    inputs.text(input.name);
    inputs.html("<code class=\"hash\">" + escaped(input.sha256) + "</code>");
  }
  out += inputs.str();
  if (!run.options.empty()) {
    Table options("options-table", "Options", facts.result);
    options.header({"Option", "Value"});
    for (const auto& [name, value] : run.options) {
      options.begin_row();
      options.text(name);
      options.text(value);
    }
    out += options.str();
  }
  return out + "</div></section>\n";
}

std::string torque_section(const Facts& facts) {
  if (facts.run.torque.empty()) return "";
  std::string out = section_head("torque", "Torques and contacts");
  for (const std::string& line : facts.run.torque) out += paragraph(line);
  out +=
      "<p class=\"note\">Details stand in dynamics.html and contact.html beside this report.</p>";
  return out + "</section>\n";
}

std::string method_section(const Facts& facts) {
  const RunSummary& run = facts.run;
  const Calibration& calibration = run.calibration;
  std::string out = section_head("method", "Method and limits");
  if (run.structure) {
    out += paragraph(
        "Structure: the relative motion of every pair of bodies is tested as rest, turn or slide "
        "along one "
        "coordinate, that coordinate is matched to the logged channels, and the most probable tree "
        "is kept "
        "(after Dalla Libera et al., 2019 and 2021). The probability is against all alternatives "
        "that were "
        "looked at, not against any that were not.");
  } else {
    out += paragraph("Structure: taken from the nominal robot; it was not examined.");
  }
  out += paragraph(
      "Geometry: all parameters together by nonlinear least squares (Ceres), residuals divided by "
      "their "
      "standard deviation, robust loss first, then outliers rejected and a plain refit.");
  out += paragraph("Gauge: " + calibration.gauge);
  out += paragraph(
      "Uncertainty: expanded, U = 2 u (coverage factor k = 2, about 95 % for a normal error). u "
      "comes from "
      "the covariance of the fit with the noise found in the residuals, allowing for their "
      "correlation in "
      "time (type A). Errors common to the whole recording, such as a wrong marker size or wrong "
      "declared "
      "intrinsics, are not in it.");
  if (calibration.folds >= 2) {
    out += paragraph(fmt::format(
        "Held out: the recording is cut into {} blocks of {}; each is predicted by a model fitted "
        "to "
        "the others. Training errors are those of the final model on the data it was fitted to.",
        calibration.folds, run.log.empty() ? "consecutive frames" : "neighbouring postures"));
  }
  Table solver("solver-table", "The solve", facts.result);
  solver.header({"Quantity", "Value"});
  const auto row = [&](std::string_view name, const std::string& pointer, Quantity quantity) {
    solver.begin_row();
    solver.text(name);
    solver.number(pointer, quantity);
  };
  row("Iterations", "/calibration/iterations", Quantity::kCount);
  row("Cost before", "/calibration/initial_cost", Quantity::kPlain);
  row("Cost after", "/calibration/final_cost", Quantity::kPlain);
  row("Noise found / noise expected", "/calibration/sigma_scale", Quantity::kPlain);
  row("Sightings used", "/calibration/sightings_used", Quantity::kCount);
  row("Sightings left out", "/calibration/sightings_rejected", Quantity::kCount);
  row("Correlation time of the residuals, s", "/calibration/correlation_time_s", Quantity::kTime);
  out += solver.str();
  if (!calibration.warnings.empty()) {
    out += "<h3>Warnings of the calibration</h3><ul id=\"calibration-warnings\">";
    for (const std::string& warning : calibration.warnings) {
      out += "<li>" + escaped(warning) + "</li>";
    }
    out += "</ul>\n";
  }
  return out + "</section>\n";
}

std::string reproduce_section(const Facts& facts, std::string_view urdf) {
  const RunSummary& run = facts.run;
  std::string out = section_head("reproduce", "How to reproduce");
  out += paragraph(
      "The same inputs (hashes above), version and command give the same figures, digit for digit; "
      "only the times differ:");
  out += "<pre id=\"command\">" + escaped(run.command) + "</pre>\n";
  if (!run.times.empty()) {
    Table times("times-table", "Stage times", facts.result);
    times.header({"Stage", "Time, s"});
    for (std::size_t k = 0; k < run.times.size(); ++k) {
      times.begin_row();
      times.text(run.times[k].stage);
      times.number(fmt::format("/run/times/{}/seconds", k), Quantity::kTime);
    }
    times.begin_row();
    times.html("<b>Total</b>");
    times.number("/run/total_s", Quantity::kTime);
    out += times.str();
  }
  if (!urdf.empty()) {
    out += "<details><summary>robot.urdf, as written beside this report</summary><pre id=\"urdf\">";
    // Line by line: escaped() makes control characters, line ends too, to spaces.
    for (std::size_t from = 0; from < urdf.size();) {
      const std::size_t end = std::min(urdf.find('\n', from), urdf.size());
      out += escaped(urdf.substr(from, end - from)) + "\n";
      from = end + 1;
    }
    out += "</pre></details>\n";
  }
  return out + "</section>\n";
}

std::string licences_section() {
  return section_head("licences", "Licences") +
         paragraph(
             "The 3-D view of this page contains three.js, revision 111, under this licence:") +
         "<pre class=\"licence\">" + std::string(three_licence()) + "</pre></section>\n";
}

}  // namespace kinescope::report
