// SPDX-License-Identifier: Apache-2.0
#include "app/report/numbers.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace kinescope::report {
namespace {

constexpr int kStatisticDigits = 3;
constexpr int kUncertaintyDigits = 2;
constexpr int kChannelDigits = 5;

/// Digits after the point so that `digits` significant ones of `value` are seen.
int decimals_for(double value, int digits) {
  if (value == 0.0 || !std::isfinite(value)) return 0;
  // Rounding may carry into the next power of ten (0.0996 to two digits is 0.10).
  const double magnitude = std::floor(std::log10(std::abs(value)));
  const double step = std::pow(10.0, magnitude - digits + 1);
  const double rounded = std::round(std::abs(value) / step) * step;
  const double carried = std::floor(std::log10(rounded) + 1e-12);
  return std::max(0, digits - 1 - static_cast<int>(carried));
}

// Less than this is rounding, in any unit of a report.
constexpr double kNothing = 1e-12;

/// "-0.00" is zero.
std::string without_negative_zero(std::string text) {
  if (text.starts_with('-') && text.find_first_not_of("-0.") == std::string::npos) text.erase(0, 1);
  return text;
}

std::string significant(double value, int digits) {
  if (!std::isfinite(value)) return "n/a";
  if (std::abs(value) < kNothing) return "0";
  if (std::abs(value) < 1e-5 || std::abs(value) >= 1e7) {
    return fmt::format("{:.{}e}", value, digits - 1);
  }
  return without_negative_zero(fmt::format("{:.{}f}", value, decimals_for(value, digits)));
}

}  // namespace

DisplayUnit display_unit(Quantity quantity) {
  switch (quantity) {
    case Quantity::kPixels:
      return {1.0, "px"};
    case Quantity::kLength:
      return {1000.0, "mm"};
    case Quantity::kAngle:
      return {180.0 / std::numbers::pi, "°"};
    case Quantity::kTime:
      return {1.0, "s"};
    case Quantity::kDelay:
      return {1000.0, "ms"};
    case Quantity::kPercent:
      return {100.0, "%"};
    case Quantity::kPlain:
    case Quantity::kCount:
    case Quantity::kChannel:
      break;
  }
  return {1.0, ""};
}

Quantity quantity_of(std::string_view si_unit) {
  if (si_unit == "rad") return Quantity::kAngle;
  if (si_unit == "m") return Quantity::kLength;
  if (si_unit == "s") return Quantity::kDelay;
  if (si_unit == "px") return Quantity::kPixels;
  return Quantity::kPlain;
}

std::string value_text(double value_si, Quantity quantity) {
  const double shown = value_si * display_unit(quantity).factor;
  if (quantity == Quantity::kCount) {
    return std::isfinite(shown) ? fmt::format("{:.0f}", shown) : "n/a";
  }
  return significant(shown, quantity == Quantity::kChannel ? kChannelDigits : kStatisticDigits);
}

std::string text_with_unit(double value_si, Quantity quantity) {
  const std::string_view unit = display_unit(quantity).text;
  const bool spaced = !unit.empty() && quantity != Quantity::kAngle;
  return value_text(value_si, quantity) + (spaced ? " " : "") + std::string(unit);
}

std::string value_and_uncertainty(double value_si, std::optional<double> expanded,
                                  Quantity quantity) {
  const double factor = display_unit(quantity).factor;
  const double value = value_si * factor;
  if (!std::isfinite(value)) return "n/a";
  const double uncertainty = expanded ? *expanded * factor : 0.0;
  if (!std::isfinite(uncertainty) || uncertainty <= 0.0) return significant(value, kChannelDigits);
  if (uncertainty < 1e-6 || uncertainty >= 1e7) {
    return fmt::format("{:.6g} ± {:.1e}", value, uncertainty);
  }
  const int decimals = decimals_for(uncertainty, kUncertaintyDigits);
  return fmt::format("{} ± {:.{}f}", without_negative_zero(fmt::format("{:.{}f}", value, decimals)),
                     uncertainty, decimals);
}

std::string rounded_value(double value_si, std::optional<double> expanded, Quantity quantity) {
  const std::string both = value_and_uncertainty(value_si, expanded, quantity);
  return both.substr(0, both.find(" ± "));
}

std::string uncertainty_text(std::optional<double> expanded, Quantity quantity) {
  if (!expanded || !std::isfinite(*expanded)) return "not determined";
  return significant(*expanded * display_unit(quantity).factor, kUncertaintyDigits);
}

std::string probability_text(double probability) {
  if (!std::isfinite(probability)) return "n/a";
  if (probability > 0.999999) return "> 0.999999";
  if (probability >= 0.99) return fmt::format("{:.6f}", probability);
  if (probability >= 0.01) return fmt::format("{:.3f}", probability);
  return fmt::format("{:.1e}", probability);
}

std::string odds_text(double log_odds) {
  if (!std::isfinite(log_odds)) return "n/a";
  const double power = log_odds / std::numbers::ln10;
  if (power >= 6.0) return "> 10⁶ : 1";
  if (power <= -6.0) return "< 1 : 10⁶";
  // Two significant digits, also before the point: odds are not known better.
  const double odds = std::exp(std::abs(log_odds));
  const double step = std::pow(10.0, std::floor(std::log10(odds)) - 1.0);
  const std::string text = significant(std::round(odds / step) * step, 2);
  return log_odds >= 0.0 ? text + " : 1" : "1 : " + text;
}

std::string drawn(double coordinate) {
  if (!std::isfinite(coordinate)) return "0";
  std::string text = without_negative_zero(fmt::format("{:.1f}", coordinate));
  if (text.ends_with(".0")) text.resize(text.size() - 2);
  return text;
}

}  // namespace kinescope::report
