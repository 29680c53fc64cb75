// SPDX-License-Identifier: Apache-2.0
//
// The one place where a number becomes text: SI in, the report's units out (mm, degrees, ms, px).
#pragma once

#include <numbers>
#include <optional>
#include <string>
#include <string_view>

namespace kinescope::report {

inline constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

/// What a number is, and with that how the report shows it.
enum class Quantity {
  kPlain,    ///< no unit, three significant digits
  kCount,    ///< whole number
  kPixels,   ///< px
  kLength,   ///< m, shown in mm
  kAngle,    ///< rad, shown in degrees
  kTime,     ///< s, shown in s
  kDelay,    ///< s, shown in ms
  kPercent,  ///< a fraction, shown in percent
  kChannel   ///< a log channel's own unit; five significant digits
};

/// The factor from SI and the unit's text: kLength gives {1000, "mm"}.
struct DisplayUnit {
  double factor = 1.0;
  std::string_view text;
};
[[nodiscard]] DisplayUnit display_unit(Quantity quantity);

/// The quantity of a parameter from its SI unit: "rad" is an angle, "m" a length, "s" a delay, "px"
/// pixels.
[[nodiscard]] Quantity quantity_of(std::string_view si_unit);

/// The number alone, three significant digits; "n/a" for what is not finite.
[[nodiscard]] std::string value_text(double value_si, Quantity quantity);
/// The number with its unit: "0.0712 px", "1.25 mm".
[[nodiscard]] std::string text_with_unit(double value_si, Quantity quantity);
/// "12.340 ± 0.012": two significant digits of the uncertainty, the value to the same place.
/// Without an uncertainty the value stands alone.
[[nodiscard]] std::string value_and_uncertainty(double value_si, std::optional<double> expanded,
                                                Quantity quantity);
/// The value alone, to the place of two significant digits of its uncertainty.
[[nodiscard]] std::string rounded_value(double value_si, std::optional<double> expanded,
                                        Quantity quantity);
/// The uncertainty alone, two significant digits; "not determined" where there is none.
[[nodiscard]] std::string uncertainty_text(std::optional<double> expanded, Quantity quantity);

/// "0.9998", "> 0.999999", "1.2e-7": a probability without false certainty.
[[nodiscard]] std::string probability_text(double probability);
/// The odds of a natural logarithm of odds: "37 : 1", "> 10⁶ : 1".
[[nodiscard]] std::string odds_text(double log_odds);

/// A coordinate of a drawing: one decimal, no trailing zero.
[[nodiscard]] std::string drawn(double coordinate);

}  // namespace kinescope::report
