// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "calib/effects/second_column.h"
#include "calib/trace/tracer.h"

namespace kinescope {
namespace {

struct Shown {
  double factor = 1.0;
  std::string unit;  ///< with the blank before it
};

Shown shown(const std::string& si_unit) {
  if (si_unit == "rad") return {180.0 / std::numbers::pi, "°"};
  if (si_unit == "m") return {1000.0, " mm"};
  if (si_unit == "s") return {1000.0, " ms"};
  return {100.0, " %"};
}

// Of a number that is known to `digits` digits of `size`.
int decimals(double size, int digits) {
  constexpr int kMost = 9;
  constexpr double kLogRounding = 1e-9;
  if (!(size > 0.0)) return 0;
  return std::clamp(digits - 1 - static_cast<int>(std::floor(std::log10(size) + kLogRounding)), 0,
                    kMost);
}

std::string amount(double value, const std::string& si_unit) {
  const Shown in = shown(si_unit);
  const double number = in.factor * value;
  return fmt::format("{:.{}f}{}", number, decimals(std::abs(number), 2), in.unit);
}

// "60.0 (59.8 to 60.2) ms".
std::string amount(const TracedEffect& effect) {
  const Shown in = shown(effect.unit);
  double low = in.factor * effect.interval.low;
  double high = in.factor * effect.interval.high;
  if (effect.size < 0.0) {
    std::swap(low, high);
    low = -low;
    high = -high;
  }
  const int places = decimals(0.5 * std::abs(high - low), 2);
  return fmt::format("{:.{}f} ({:.{}f} to {:.{}f}){}", in.factor * std::abs(effect.size), places,
                     low, places, high, places, in.unit);
}

// What is said, and of which column.
struct Clause {
  bool of_joint = false;  ///< of the joint's own column
  std::string words;
};

Clause clause(const SecondColumn& second, const TracedEffect& effect) {
  const std::string size = amount(effect);
  const std::string& name = effect.id.effect;
  if (name == "droop")
    return {true,
            second.lifted
                ? fmt::format("is ahead of {} by up to {} against its load", second.column, size)
                : fmt::format("stays behind {} by up to {} under load", second.column, size)};
  if (name == "dead_band") {
    const bool of_joint = effect.id.place != second.column;
    return {of_joint, fmt::format("follows {} with a dead band of {}",
                                  of_joint ? second.column : second.channel, size)};
  }
  if (name == "quantisation") return {false, fmt::format("comes in steps of {}", size)};
  const bool more = effect.size > 0.0;
  if (name == "acceleration_lag")
    return {true, fmt::format("is {} {} by up to {} as it gains speed",
                              more ? "behind" : "ahead of", second.column, size)};
  if (name == "time_offset")
    return {false, fmt::format("is {} {} {}", size, more ? "ahead of" : "behind", second.channel)};
  return {false, fmt::format("says {} {} than {}", size, more ? "more" : "less", second.channel)};
}

// "q1_cmd is .., comes in ..; q1 stays .., follows .."; empty without effects.
std::string effects_words(const SecondColumn& second) {
  std::string out;
  for (const bool of_joint : {false, true}) {
    std::string part;
    for (const TracedEffect& effect : second.trace.accepted) {
      const Clause said = clause(second, effect);
      if (said.of_joint != of_joint) continue;
      part += part.empty() ? (of_joint ? second.channel : second.column) + " " : ", ";
      part += said.words;
    }
    if (!part.empty()) out += (out.empty() ? "" : "; ") + part;
  }
  return out;
}

std::string rivals_words(const std::vector<Ambiguity>& ambiguities) {
  std::string out;
  for (const Ambiguity& ambiguity : ambiguities) {
    for (std::size_t k = 1; k < ambiguity.words.size(); ++k)
      out += fmt::format("; or {}, which this recording cannot tell from that", ambiguity.words[k]);
  }
  return out;
}

// "noise", or by how much it is more; of postures nobody knows.
std::string nature_of_rest(const SecondColumn& second) {
  if (second.noise == 0.0) return "unexplained";
  const double over = second.after / second.noise;
  if (over <= trace::kLasts) return "noise";
  return fmt::format("{:.1f} times what neighbouring samples differ by: not noise alone", over);
}

}  // namespace

std::string words_of(const SecondColumn& second) {
  if (second.before == 0.0) {
    if (second.offset == 0.0)
      return fmt::format("{} is equal to {}", second.column, second.channel);
    return fmt::format("{} is equal to {} but for a constant of {}", second.column, second.channel,
                       amount(second.offset, second.unit));
  }
  const std::string differs = fmt::format("{} differs from {} by {} (rms)", second.column,
                                          second.channel, amount(second.before, second.unit));
  if (second.trace.verdict == TraceVerdict::kNothingToSay)
    return fmt::format("{}: {}", differs, second.trace.reason);
  const std::string effects = effects_words(second);
  if (effects.empty()) return fmt::format("{}, which is {}", differs, nature_of_rest(second));
  return fmt::format("{}{}; what is left, {}, is {}", effects,
                     rivals_words(second.trace.ambiguities), amount(second.after, second.unit),
                     nature_of_rest(second));
}

}  // namespace kinescope
