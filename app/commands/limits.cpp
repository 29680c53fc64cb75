// SPDX-License-Identifier: Apache-2.0
#include "app/commands/limits.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>

#include <fmt/format.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct Quantity {
  const char* name;
  double (*value)(const RunSummary&);
};

constexpr double kMillimetre = 1e3;
constexpr double kDegree = 57.29577951308232;

const std::array kQuantities{
    Quantity{"held_out_px",
             [](const RunSummary& r) {
               return r.calibration.kind == MeasurementKind::kCorners ? r.calibration.held_out_rms
                                                                      : kUnknown;
             }},
    Quantity{"training_px",
             [](const RunSummary& r) {
               return r.calibration.kind == MeasurementKind::kCorners ? r.calibration.training_rms
                                                                      : kUnknown;
             }},
    Quantity{"held_out_ratio",
             [](const RunSummary& r) {
               return r.calibration.held_out_rms / r.calibration.training_rms;
             }},
    Quantity{"held_out_mm",
             [](const RunSummary& r) { return kMillimetre * r.errors.all.held_out_m.rms; }},
    Quantity{"held_out_deg",
             [](const RunSummary& r) { return kDegree * r.errors.all.held_out_rad.rms; }},
    Quantity{"axis_deg",
             [](const RunSummary& r) {
               double worst = 0.0;
               for (const JointEstimate& joint : r.calibration.joints) {
                 worst = std::max(worst, joint.direction_sigma_rad.value_or(0.0));
               }
               return 2.0 * kDegree * worst;
             }},
    Quantity{"structure_probability",
             [](const RunSummary& r) { return r.structure ? r.structure->probability : kUnknown; }},
};

std::string known_quantities() {
  std::string names;
  for (const Quantity& quantity : kQuantities) {
    names += fmt::format("{}{}", names.empty() ? "" : ", ", quantity.name);
  }
  return names;
}

}  // namespace

std::vector<Limit> parse_limits(const std::vector<std::string>& texts) {
  std::vector<Limit> limits;
  for (const std::string& text : texts) {
    const std::size_t sign = text.find_first_of("<>");
    const auto number =
        sign == std::string::npos ? std::nullopt : parse_number(text.substr(sign + 1));
    if (!number || !(*number == *number)) {
      throw bad_request("--fail-on", fmt::format("'{}' is no limit", text),
                        "write it as \"held_out_px>0.2\", in quotes: a shell takes > for itself");
    }
    const std::string name = text.substr(0, sign);
    if (std::ranges::find(kQuantities, name, &Quantity::name) == kQuantities.end()) {
      throw bad_request("--fail-on", fmt::format("no quantity is named '{}'", name),
                        "the quantities are " + known_quantities());
    }
    limits.push_back({name, text[sign], *number});
  }
  return limits;
}

bool within_limits(const RunSummary& run, const std::vector<Limit>& limits,
                   const Console& console) {
  bool within = true;
  for (const Limit& limit : limits) {
    const auto quantity = std::ranges::find(kQuantities, limit.quantity, &Quantity::name);
    const double value = quantity->value(run);
    // What is not known is not within a limit.
    const bool outside =
        limit.comparison == '>' ? !(value <= limit.value) : !(value >= limit.value);
    if (!outside) continue;
    within = false;
    console.say_passed_limit(
        fmt::format("{}{}{}: {:.4g}", limit.quantity, limit.comparison, limit.value, value));
  }
  return within;
}

void require_trace(const RunSummary& run) {
  if (!run.trace || run.trace->verdict != TraceVerdict::kNothingToSay) return;
  throw undetermined("tracing", run.trace->reason,
                     "record longer, through more postures; the calibration stands");
}

void require(const Answer& answer, std::string_view see) {
  if (answer.given) return;
  throw undetermined(answer.where, answer.what, fmt::format("{}; {}", answer.remedy, see));
}

}  // namespace kinescope
