// SPDX-License-Identifier: Apache-2.0
#include "app/report/trace_words.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "app/report/findings.h"
#include "app/report/numbers.h"
#include "app/report/trace_lines.h"
#include "calib/trace/stage.h"

namespace kinescope {
namespace report {
namespace {

// Significant digits down to the second one of the interval's half, between 2 and 6.
int digits_for(double value, double half_width) {
  if (!(half_width > 0.0) || !(std::abs(value) > 0.0)) return 3;
  const double digits =
      std::floor(std::log10(std::abs(value))) - std::floor(std::log10(half_width)) + 2.0;
  return static_cast<int>(std::clamp(digits, 2.0, 6.0));
}

const AmountUnit kPercent{100.0, "%"};

// Of numbers without a unit: coefficients of the lens, ratios of two motions; else shares.
bool is_share(const EffectId& id, const std::string& unit) {
  return unit.empty() && id.effect != "lens_distortion" && id.effect != "coupling";
}

// "0.0034", "64", "420": two digits, and no power of ten for what is large.
std::string two_digits(double value) {
  return std::abs(value) < 10.0 ? fmt::format("{:.2g}", value) : fmt::format("{:.0f}", value);
}

}  // namespace

AmountUnit amount_unit(const std::string& si_unit) {
  static const std::map<std::string, AmountUnit> kUnits{{
                                                            "rad",
                                                            {kDegreesPerRadian, "°"},
                                                        },
                                                        {"m", {1e3, "mm"}},
                                                        {"s", {1e3, "ms"}},
                                                        {"m/m", {1e3, "mm/m"}},
                                                        {"m/turn", {1e3, "mm/turn"}},
                                                        {"rad/m", {kDegreesPerRadian, "°/m"}},
                                                        {"rad/s", {kDegreesPerRadian, "°/s"}},
                                                        {"m/s", {1e3, "mm/s"}},
                                                        {"s/s", {1e6, "ppm"}}};
  const auto found = kUnits.find(si_unit);
  return found == kUnits.end() ? AmountUnit{1.0, si_unit} : found->second;
}

std::string amount_text(double value_si, const std::string& si_unit) {
  AmountUnit unit = amount_unit(si_unit);
  double value = value_si * unit.factor;
  // A line of a rolling shutter takes microseconds.
  if (si_unit == "s" && std::abs(value) < 0.1) {
    value *= 1e3;
    unit.text = "µs";
  }
  const bool tight = unit.text.empty() || unit.text == "°";
  return fmt::format("{:.4g}{}{}", value, tight ? "" : " ", unit.text);
}

std::string limit_text(const NotFoundEffect& missing) {
  const AmountUnit unit = amount_unit(missing.unit);
  const double value = missing.smallest_size * unit.factor;
  if (!missing.unit.empty()) {
    const bool micro = missing.unit == "s" && std::abs(value) < 0.1;
    return fmt::format("{}{}{}", two_digits(micro ? 1e3 * value : value),
                       unit.text == "°" ? "" : " ", micro ? "µs" : unit.text);
  }
  if (missing.id.effect == "lens_distortion")
    return two_digits(missing.smallest_size) + " (coefficient)";
  if (missing.id.effect == "coupling")
    return two_digits(missing.smallest_size) + " of the other joint's motion";
  return fmt::format("{} {}", two_digits(kPercent.factor * missing.smallest_size), kPercent.text);
}

namespace {

// "periods 2 per turn", "at 3.20 s", "joint2" of a coupling.
std::string scan_text(const TracedEffect& effect, double scan, const std::string& words) {
  if (!words.empty()) return words;
  if (effect.scan_unit.starts_with("per ")) return fmt::format("{:.4g} {}", scan, effect.scan_unit);
  if (effect.scan_unit == "s" && effect.scan_name == "at") return fmt::format("{:.2f} s", scan);
  return amount_text(scan, effect.scan_unit);
}

}  // namespace

std::string effect_name(const TracedEffect& effect) {
  std::string name = fmt::format("{} at {}", effect.id.effect, effect.id.place);
  if (effect.scan_name.empty()) return name;
  std::string at = scan_text(effect, effect.scan, effect.scan_words);
  for (const ScanAlternative& other : effect.as_likely)
    at += " or " + scan_text(effect, other.scan, other.words);
  return fmt::format("{} ({} {})", name, effect.scan_name, at);
}

std::string plain_name(const EffectId& id) {
  std::string effect = id.effect;
  std::ranges::replace(effect, '_', ' ');
  return fmt::format("{} at {}", effect, id.place);
}

std::string size_words(const TracedEffect& effect) {
  const AmountUnit unit = is_share(effect.id, effect.unit) ? kPercent : amount_unit(effect.unit);
  const double half = 0.5 * (effect.interval.high - effect.interval.low);
  const bool small_time = effect.unit == "s" && std::abs(effect.size) < 1e-4;
  const double factor = unit.factor * (small_time ? 1e3 : 1.0);
  const int digits = digits_for(effect.size * factor, half * factor);
  const std::string words =
      fmt::format("{:.{}g} ({:.{}g} to {:.{}g})", effect.size * factor, digits,
                  effect.interval.low * factor, digits, effect.interval.high * factor, digits);
  const std::string_view name = small_time ? "µs" : std::string_view(unit.text);
  return name.empty() ? words : fmt::format("{} {}", words, name);
}

std::string other_sizes_words(const TracedEffect& effect) {
  std::map<std::string, std::pair<double, std::string>> squares;  // by quantity; its unit
  for (const EffectValue& value : effect.values) {
    const std::string& name = value.parameter.name;
    const bool part = name.ends_with(" x") || name.ends_with(" y") || name.ends_with(" z");
    if (!part || value.parameter.unit == effect.unit) continue;
    auto& [square, unit] = squares[name.substr(0, name.size() - 2)];
    square += value.value * value.value;
    unit = value.parameter.unit;
  }
  std::string out;
  for (const auto& [quantity, sum] : squares)
    out += fmt::format(", {} {}", quantity, amount_text(std::sqrt(sum.first), sum.second));
  return out;
}

std::string error_change_words(const HeldOutError& before, const HeldOutError& after) {
  return fmt::format("{} → {}", amount_text(before.value, before.unit),
                     amount_text(after.value, after.unit));
}

std::string ambiguity_words(const Ambiguity& ambiguity) {
  std::string names;
  for (std::size_t i = 0; i < ambiguity.effects.size(); ++i) {
    const EffectId& id = ambiguity.effects[i];
    names += fmt::format("{}{} at {}",
                         i == 0                              ? ""
                         : i + 1 == ambiguity.effects.size() ? " or "
                                                             : ", ",
                         id.effect, id.place);
  }
  return fmt::format("{}: this recording cannot tell them apart. To decide: {}.", names,
                     ambiguity.record);
}

std::string rest_words(const Rest& rest) {
  return fmt::format(
      "At {} something is left that no known effect explains; it follows the {} and makes {:.1f} % "
      "of the residual. Modelled as a {}: {} on unseen data.",
      rest.place, rest.covariate, 100.0 * rest.explained, rest.is_field() ? "field" : "curve",
      error_change_words(rest.held_out_before, rest.held_out_after));
}

namespace {

bool holds_clock(const Trace& trace) {
  return std::ranges::any_of(trace.accepted, [](const TracedEffect& effect) {
    return effect.id == EffectId{"time_offset", "clock"};
  });
}

// The calibration always estimates the clocks' offset; tracing begins without it.
std::string whole_change_words(const Trace& trace, const HeldOutError& after) {
  return fmt::format("{}{} → {}",
                     amount_text(trace.held_out_before.value, trace.held_out_before.unit),
                     start_words(trace), amount_text(after.value, after.unit));
}

// The model with the effects is the one that is exported; curves stand in the report only.
std::string unknown_words(const Trace& trace) {
  const std::string curves = trace.rest.size() > 1           ? "curves"
                             : trace.rest.front().is_field() ? "a field"
                                                             : "a curve";
  if (trace.accepted.empty()) {
    return fmt::format("{}. Error on unseen data {} with {} for it, which no product carries.",
                       trace.reason, whole_change_words(trace, trace.held_out_after), curves);
  }
  const HeldOutError& with_effects = trace.rest.front().held_out_before;
  return fmt::format(
      "{}; beyond that {}. Error on unseen data {} with the effects, {} with {} for the rest, "
      "which "
      "no product carries.",
      trace::found_words(trace.found, trace.accepted), trace.reason,
      whole_change_words(trace, with_effects),
      amount_text(trace.held_out_after.value, trace.held_out_after.unit), curves);
}

// A sentence a finding, the verdict first.
std::vector<std::string> findings_of(const Trace& trace) {
  switch (trace.verdict) {
    case TraceVerdict::kNotRun:
      return {};
    case TraceVerdict::kNothingToSay:
      return {fmt::format("nothing can be said: {}.", trace.reason)};
    case TraceVerdict::kClean:
      return {fmt::format("nothing is left to explain; the error on unseen data, {}, is noise.",
                          amount_text(trace.held_out_after.value, trace.held_out_after.unit))};
    case TraceVerdict::kEffects:
    case TraceVerdict::kAmbiguous:
    case TraceVerdict::kUnknown:
      break;
  }
  std::vector<std::string> out{trace.verdict == TraceVerdict::kUnknown && !trace.rest.empty()
                                   ? unknown_words(trace)
                                   : fmt::format("{}. Error on unseen data {}.", trace.reason,
                                                 whole_change_words(trace, trace.held_out_after))};
  for (const TracedEffect& effect : trace.accepted) {
    out.push_back(fmt::format("{}: {}{}; {}. Check: {}.", effect_name(effect), size_words(effect),
                              other_sizes_words(effect), effect.words, effect.check));
  }
  for (const Ambiguity& ambiguity : trace.ambiguities) out.push_back(ambiguity_words(ambiguity));
  for (const Rest& rest : trace.rest) out.push_back(rest_words(rest));
  return out;
}

}  // namespace

std::string start_words(const Trace& trace) {
  return holds_clock(trace) ? " (clock offset held at 0)" : "";
}

std::string trace_paragraph(const Trace& trace) {
  constexpr std::size_t kMostSentences = 4;  // sentences; the others stand in their own section
  std::vector<std::string> findings = findings_of(trace);
  if (findings.size() > kMostSentences) findings.resize(1);
  std::string out;
  for (const std::string& finding : findings) out += (out.empty() ? "" : " ") + sentence(finding);
  return out;
}

}  // namespace report

std::vector<std::string> trace_lines(const Trace& trace) {
  std::vector<std::string> out = report::findings_of(trace);
  for (std::size_t i = 0; i < out.size(); ++i) out[i].insert(0, i == 0 ? "Tracing: " : "  ");
  return out;
}

std::vector<std::string> second_column_lines(const std::vector<SecondColumn>& columns) {
  std::vector<std::string> out;
  for (const SecondColumn& column : columns) out.push_back(report::sentence(words_of(column)));
  return out;
}

}  // namespace kinescope
