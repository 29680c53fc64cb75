// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/verdict.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "calib/trace/lasting.h"
#include "calib/trace/lasting_body.h"

namespace kinescope::trace {
namespace {

// Less than this of what named effects explain at its place is the imperfection of their shapes.
constexpr double kSlightShare = 1e-3;
// Of what is left: more than that is no error of single bodies.
constexpr double kMostOfIt = 0.5;

// The answer need not be `unknown` for it.
bool is_slight(const Rest& rest, double squares, double base_squares, const Trace& trace) {
  double named = 0.0;
  for (const TracedEffect& effect : trace.accepted) {
    if (same_place(rest.place, effect.id.place)) named += effect.explained;
  }
  return rest.explained * squares < kSlightShare * named * base_squares;
}

// "the error of joint2, joint3 repeats with its value"; empty without curves.
std::string curve_words(const std::vector<TracedEffect>& accepted) {
  std::string names;
  for (const TracedEffect& effect : accepted) {
    if (!effect.is_curve() || names.find(effect.id.place) != std::string::npos) continue;
    names += (names.empty() ? "" : ", ") + effect.id.place;
  }
  return names.empty() ? names : fmt::format("the error of {} repeats with its value", names);
}

std::string reading_words(const Stage& now, const CommonMotion& motion) {
  const RestPlace& place = now.fit.rest_places[motion.place];
  return fmt::format(
      "readings of {} are uncertain by {:.2g} {} (rms), as their steps or their noise say: {:.0f} "
      "% of what is left",
      place.name, motion.size, place.unit, 100.0 * std::min(1.0, motion.share));
}

std::string shared_motion_words(const Stage& now, const CommonMotion& motion) {
  const RestPlace& place = now.fit.rest_places[motion.place];
  return fmt::format(
      "all that {} moves differs alike from instant to instant, by {:.3g} {} of it (rms), which "
      "makes {:.0f} % of what is left: a vibration or unsteady readings, that no known effect "
      "explains",
      place.name, motion.size, place.unit, 100.0 * std::min(1.0, motion.share));
}

// "what tag_12 leaves, .., lasts": of one body, which all the others hide; empty: of none.
std::string lasting_body_words(const Stage& now) {
  const Linearisation& linear = now.fit.linear;
  if (!linear.whitened_by_neighbours) return "";
  const auto found = find_lasting_body(linear, now.system.freedom(), kLasts);
  if (!found || std::cmp_greater_equal(found->body, linear.body_names.size())) return "";
  return fmt::format(
      "what {} leaves, {:.3g} {}, is {:.1f} times what it differs by from one frame to the next: "
      "it lasts, and no known effect explains it",
      linear.body_names[static_cast<std::size_t>(found->body)], found->rms, linear.unit_name,
      found->over_differences);
}

// What no known effect explains; empty where there is nothing of the kind.
std::string unknown_words(const Stage& now, bool slight, const std::optional<CommonMotion>& common,
                          const Trace& trace) {
  const std::string lasting = lasting_words(trace.left_over);
  if (!slight) {
    const Rest& rest = trace.rest.front();
    std::string words =
        fmt::format("structure is left at {}, over {}, that no known effect explains", rest.place,
                    rest.covariate);
    if (!lasting.empty()) words += "; without that curve, what is left is " + lasting;
    return words;
  }
  if (const std::string curves = curve_words(trace.accepted); !curves.empty()) {
    return fmt::format(
        "{}, for a reason that no known effect has the shape of; it is part of the model as it is",
        curves);
  }
  const std::string beyond =
      trace.accepted.empty() ? "" : found_words(trace.found, trace.accepted) + "; beyond that ";
  if (!lasting.empty())
    return fmt::format("{}what is left is {}: no known effect explains it", beyond, lasting);
  if (now.fit.linear.whitened_by_neighbours && trace.over_neighbours > kLasts) {
    return fmt::format(
        "{}what is left, {:.3g} {}, is {:.1f} times what differs from one frame to the next: it "
        "lasts, and no known effect explains it",
        beyond, trace.held_out_after.value, trace.held_out_after.unit, trace.over_neighbours);
  }
  if (common && !is_of_readings(now, *common)) return beyond + shared_motion_words(now, *common);
  const std::string body = lasting_body_words(now);
  return body.empty() ? body : beyond + body;
}

}  // namespace

std::optional<CommonMotion> common_motion(const Stage& stage) {
  const auto found = find_common_motion(stage.system, stage.fit.rest_places, stage.fit.clock);
  return found && found->largest_share > kMostOfIt ? found : std::nullopt;
}

bool is_of_readings(const Stage& stage, const CommonMotion& motion) {
  const RestPlace& place = stage.fit.rest_places[motion.place];
  return motion.size >= place.reading_error_least && motion.size <= place.reading_error_most;
}

bool same_place(const std::string& rest, const std::string& effect) {
  return rest == effect || rest.starts_with(effect + " ") || effect.starts_with(rest + " ");
}

std::string cannot_tell_words(const Ambiguity& ambiguity) {
  std::string names;
  for (const EffectId& id : ambiguity.effects) names += (names.empty() ? "" : " or ") + name_of(id);
  return fmt::format("{}: this recording cannot tell them apart", names);
}

void conclude(const Stage& now, double base_squares, Trace& trace) {
  const bool slight = std::ranges::all_of(trace.rest, [&](const Rest& rest) {
    return is_slight(rest, now.system.total().rr, base_squares, trace);
  });
  if (slight) trace.held_out_after = now.error;  // without curves
  const std::optional<CommonMotion> common = slight ? common_motion(now) : std::nullopt;
  if (std::string unknown = unknown_words(now, slight, common, trace); !unknown.empty()) {
    trace.verdict = TraceVerdict::kUnknown;
    trace.reason = std::move(unknown);
  } else if (!trace.ambiguities.empty()) {
    trace.verdict = TraceVerdict::kAmbiguous;
    trace.reason = trace.accepted.empty() ? "" : found_words(trace.found, trace.accepted) + "; ";
    trace.reason += cannot_tell_words(trace.ambiguities.front());
  } else if (!trace.accepted.empty()) {
    trace.verdict = TraceVerdict::kEffects;
    trace.reason = found_words(trace.found, trace.accepted);
    for (const Rest& rest : trace.rest) {
      trace.reason += fmt::format(
          "; what is left at {} over {} is less than a thousandth of what they explain there",
          rest.place, rest.covariate);
    }
    if (common) trace.reason += "; " + reading_words(now, *common);
  } else {
    trace.verdict = TraceVerdict::kClean;
    trace.reason = fmt::format("the error on unseen data, {:.3g} {}, is noise",
                               trace.held_out_after.value, trace.held_out_after.unit);
    if (common) trace.reason += ": " + reading_words(now, *common);
  }
}

}  // namespace kinescope::trace
