// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "app/report/findings.h"
#include "app/report/html.h"
#include "app/report/sections.h"
#include "app/report/trace_words.h"
#include "app/report/verdict_words.h"

namespace kinescope::report {
namespace {

std::string names_of(const std::vector<TracedEffect>& effects) {
  std::vector<std::string> names;
  for (const TracedEffect& effect : effects) {
    names.push_back(effect.is_curve() ? "what repeats with the value of " + effect.id.place
                                      : plain_name(effect.id));
  }
  return joined(names);
}

// What follows the joints in the verdict's one sentence. `declares_another`: a nominal robot that
// the calibration differs from.
std::string outcome_words(const Trace& trace, bool declares_another) {
  const std::string corrected =
      trace.accepted.empty() ? "" : ", corrected for " + names_of(trace.accepted);
  switch (trace.verdict) {
    case TraceVerdict::kClean:
      return declares_another ? ", and nothing else wrong with it that this recording shows"
                              : ", and nothing wrong with it that this recording shows";
    case TraceVerdict::kEffects:
      return corrected;
    case TraceVerdict::kAmbiguous:
      return corrected + ", or for what this recording cannot tell from that";
    case TraceVerdict::kUnknown:
      if (!trace.rest.empty())
        return corrected + fmt::format("; at {} something is left that no known effect explains",
                                       trace.rest.front().place);
      if (std::ranges::any_of(trace.accepted, &TracedEffect::is_curve))
        return corrected + ", whose cause is unknown";
      return corrected + "; what is left is no noise, and no known effect explains it";
    case TraceVerdict::kNothingToSay:
      return "; whether it lacks anything, the recording is too short to tell";
    case TraceVerdict::kNotRun:
      break;
  }
  return "";
}

bool is_answer(const Facts& facts) { return facts.result.at("verdict").at("answer").get<bool>(); }

std::string headline(const Facts& facts) {
  const nlohmann::json& verdict = facts.result.at("verdict");
  if (!is_answer(facts))
    return sentence("No answer: " + verdict.at("no_answer").get<std::string>());
  const std::optional<Trace>& trace = facts.run.trace;
  const std::string nominal = nominal_words(facts.run);
  return sentence(joints_words(facts.run) +
                  (trace ? outcome_words(*trace, !nominal.empty()) : "")) +
         nominal;
}

// The error's place in the result document, data that the fit has not seen first, lengths first.
struct Figure {
  std::string pointer;
  Quantity quantity = Quantity::kLength;
  bool held_out = true;
};

std::optional<Figure> figure_of_merit(const Facts& facts) {
  for (const bool held_out : {true, false}) {
    const std::string state = held_out ? "held_out" : "training";
    const std::array<Figure, 2> figures{
        {{fmt::format("/errors/all/{}_m/rms", state), Quantity::kLength, held_out},
         {fmt::format("/errors/all/{}_px/rms", state), Quantity::kPixels, held_out}}};
    for (const Figure& figure : figures)
      if (number_at(facts.result, figure.pointer)) return figure;
  }
  return std::nullopt;
}

// " (95 %: 0.036 mm to 0.041 mm)": as wide, in proportion, as that of the error that tracing took.
std::string interval_words(const Facts& facts, const Figure& figure) {
  const std::optional<Trace>& trace = facts.run.trace;
  if (!figure.held_out || !trace || !(trace->held_out_after.value > 0.0)) return "";
  const HeldOutError& of = trace->held_out_after;
  const double value = number_at(facts.result, figure.pointer).value_or(0.0) / of.value;
  return fmt::format(" (95 %: {} to {})", text_with_unit(value * of.interval.low, figure.quantity),
                     text_with_unit(value * of.interval.high, figure.quantity));
}

// The error that the fit made of what it has not seen; `css_class`: "merit" where it is the page's
// own figure, "check" beside one that says more.
std::string check(const Facts& facts, std::string_view css_class) {
  const std::optional<Figure> figure = figure_of_merit(facts);
  if (!figure) return "";
  const MeasurementKind kind = facts.run.calibration.kind;
  std::string of = kind == MeasurementKind::kPoint ? "points" : "markers";
  if (figure->held_out) of += facts.run.log.empty() ? " in stretches" : " at postures";
  of += figure->held_out ? " that the fit has not seen" : " in the data of the fit itself";
  if (figure->quantity == Quantity::kLength && kind == MeasurementKind::kCorners)
    of += ", across the line of sight";
  return fmt::format("<p class=\"{}\"><b>{}</b><span>rms error of {}{}</span></p>\n", css_class,
                     inline_number(facts.result, figure->pointer, figure->quantity), of,
                     escaped(interval_words(facts, *figure)));
}

// "2.9 mm, 0.19°" of the result's tip; `prefix`: "" or "among_".
std::string tip_numbers(const Facts& facts, std::string_view prefix) {
  const std::string rotation = fmt::format("/tip/{}rotation_expanded_rad", prefix);
  std::string text = inline_uncertainty(
      facts.result, fmt::format("/tip/{}translation_expanded_m", prefix), Quantity::kLength);
  if (number_at(facts.result, rotation))
    text += ", " + inline_uncertainty(facts.result, rotation, Quantity::kAngle);
  return text;
}

// The answer to "how exactly does the URDF say where the last link is".
std::string tip_merit(const Facts& facts, const TipUncertainty& tip) {
  const KinematicTree& tree = facts.run.calibration.tree;
  const std::string base = base_words(tree);
  std::string out = fmt::format(
      "<p class=\"merit\"><b>{}</b><span>how exactly the URDF says where the last link is: {} on "
      "{} "
      "in the frame of {}, expanded uncertainty (k = 2) over the postures of the "
      "recording at exact joint values{}</span></p>\n",
      tip_numbers(facts, ""), escaped(marker_name(tip.marker)),
      escaped(tree.links[tip.link.index()].name), escaped(base),
      is_model_short(facts.run) ? "; what the model lacks comes on top" : "");
  if (!is_base_apart(tip)) return out;
  return out + fmt::format(
                   "<p class=\"check\"><b>{}</b><span>the same with the base placed anew: most of "
                   "the above is how {} is turned and placed</span></p>\n",
                   tip_numbers(facts, "among_"), escaped(base));
}

std::string merit(const Facts& facts) {
  const std::optional<TipUncertainty>& tip = facts.analysis.tip;
  if (!tip) return check(facts, "merit");
  return tip_merit(facts, *tip) + check(facts, "check");
}

// What the answer does not rest on, and what the readers of the files said.
std::string rejections(const Facts& facts) {
  const nlohmann::json& calibration = facts.result.at("calibration");
  const int rejected = calibration.at("sightings_rejected").get<int>();
  std::vector<std::string> parts;
  if (rejected > 0) {
    const int seen = rejected + calibration.at("sightings_used").get<int>();
    parts.push_back(fmt::format("{} of {} sightings as outliers of the fit", rejected, seen));
  }
  for (const auto& [reason, count] : facts.run.rejected)
    parts.push_back(fmt::format("{} detection{}: {}", count, count == 1 ? "" : "s", reason));
  std::string out;
  if (!parts.empty()) {
    std::string words;
    for (const std::string& part : parts) words += (words.empty() ? "" : "; ") + part;
    out += "<p class=\"next\"><b>Rejected</b> " + escaped(words) + ".</p>\n";
  }
  if (facts.run.warnings.empty()) return out;
  constexpr std::size_t kMostWarnings = 3;  // the others stand under data quality
  const std::vector<std::string>& warnings = facts.run.warnings;
  out += "<ul class=\"warned\">\n";
  for (std::size_t k = 0; k < std::min(kMostWarnings, warnings.size()); ++k)
    out += "<li>" + escaped(warnings[k]) + "</li>\n";
  if (warnings.size() > kMostWarnings)
    out +=
        fmt::format("<li>and {} more under data quality</li>\n", warnings.size() - kMostWarnings);
  return out + "</ul>\n";
}

// What was found, with the error on unseen data without and with it.
struct Gain {
  std::string what;
  HeldOutError without;
  HeldOutError with;
  std::string_view with_words = "with it";
};

std::string named(const TracedEffect& effect) {
  if (effect.is_curve()) return names_of({effect});
  return fmt::format("{}: {}{}{}{}", effect_name(effect), size_words(effect),
                     other_sizes_words(effect), effect.words.empty() ? "" : "; ", effect.words);
}

std::vector<Gain> gains_of(const Trace& trace) {
  std::vector<Gain> out;
  for (const TracedEffect& effect : trace.accepted)
    out.push_back({named(effect), effect.held_out_before, effect.held_out_after});
  for (const Rest& rest : trace.rest)
    out.push_back({fmt::format("{}: unexplained, follows the {}", rest.place, rest.covariate),
                   rest.held_out_before, rest.held_out_after, "with a curve for it"});
  return out;
}

std::string bar(const HeldOutError& error, double most, std::string_view css_class,
                std::string_view words) {
  return fmt::format(
      "<div class=\"gain\"><i class=\"{}\" style=\"width:{:.1f}%\"></i><span>{} {}</span></div>",
      css_class, 55.0 * error.value / most, escaped(amount_text(error.value, error.unit)), words);
}

// The largest ones: what they leave is in the section on effects.
std::string gains(const Facts& facts) {
  constexpr std::size_t kMostGains = 3;
  if (!facts.run.trace) return "";
  std::vector<Gain> all = gains_of(*facts.run.trace);
  std::erase_if(all, [](const Gain& gain) { return !(gain.without.value > 0.0); });
  if (all.empty()) return "";
  std::ranges::stable_sort(all, std::greater{},
                           [](const Gain& gain) { return gain.without.value; });
  const std::size_t more = all.size() - std::min(all.size(), kMostGains);
  all.resize(all.size() - more);
  const double most = all.front().without.value;
  std::string out = "<ul class=\"gains\">\n";
  for (const Gain& gain : all) {
    out += "<li>" + escaped(gain.what) + bar(gain.without, most, "without", "without") +
           bar(gain.with, most, "with", gain.with_words) + "</li>\n";
  }
  if (more > 0) out += fmt::format("<li><a href=\"#trace\">and {} more</a></li>\n", more);
  return out + "</ul>\n";
}

}  // namespace

std::string first_screen(const Facts& facts, std::string_view lights) {
  // Of what is no answer, no figure stands out and nothing is ticked.
  const bool answer = is_answer(facts);
  return fmt::format(
      "<p class=\"headline\">{}</p>\n<div class=\"first\">\n<div class=\"said\">\n{}{}{}{}"
      "<p class=\"next\"><b>What to record next</b> {}</p>\n</div>\n<div class=\"shown\">\n{}"
      "<div id=\"viewer-still\">{}</div>\n{}</div>\n</div>\n",
      escaped(headline(facts)), answer ? merit(facts) : "", answer ? lights : "", gains(facts),
      rejections(facts), with_code(facts.verdict.next), viewer_panel(), robot_still(facts),
      film(facts));
}

}  // namespace kinescope::report
