// SPDX-License-Identifier: Apache-2.0
//
// What tracing found, in words of the report.
#pragma once

#include <string>

#include "calib/trace/trace_result.h"

namespace kinescope::report {

/// "0.598°", "-39.99 ms", "0.0021 1/m": of SI units, in those people use.
[[nodiscard]] std::string amount_text(double value, const std::string& unit);
/// The unit alone, and the factor to it.
struct AmountUnit {
  double factor = 1.0;
  std::string text;
};
[[nodiscard]] AmountUnit amount_unit(const std::string& unit);
/// "0.25 %", "0.062 mm": from where on an effect that was not found would have been.
[[nodiscard]] std::string limit_text(const NotFoundEffect& missing);
/// ", run-out 0.26 mm": quantities beside the one that is the effect's size.
[[nodiscard]] std::string other_sizes_words(const TracedEffect& effect);
/// "eccentricity at ch0"; with the value of its scan: ", 1 per turn".
[[nodiscard]] std::string effect_name(const TracedEffect& effect);
/// "time offset at clock": the identifier as words.
[[nodiscard]] std::string plain_name(const EffectId& id);
/// "0.598° (0.596° to 0.600°)".
[[nodiscard]] std::string size_words(const TracedEffect& effect);
[[nodiscard]] std::string error_change_words(const HeldOutError& before, const HeldOutError& after);
[[nodiscard]] std::string ambiguity_words(const Ambiguity& ambiguity);
[[nodiscard]] std::string rest_words(const Rest& rest);
/// " (clock offset held at 0)" where that is how tracing began; else nothing.
[[nodiscard]] std::string start_words(const Trace& trace);
/// What was found, for the head of a report; empty where nothing was traced.
[[nodiscard]] std::string trace_paragraph(const Trace& trace);

}  // namespace kinescope::report
