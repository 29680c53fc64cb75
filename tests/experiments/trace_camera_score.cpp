// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/trace_camera_score.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace kinescope {
namespace {

using truth::InjectedEffect;

bool is_at(const EffectId& found, const InjectedEffect& injected) {
  const std::string place = truth::place_in_library(injected);
  return found.effect == injected.effect && found.place == place;
}

bool is_same(const TracedEffect& found, const InjectedEffect& injected) {
  if (!is_at(found.id, injected)) return false;
  return injected.effect != "coupling" || found.scan_words == injected.with;
}

const TracedEffect* find(const Trace& trace, const InjectedEffect& injected) {
  const auto found = std::ranges::find_if(
      trace.accepted, [&](const TracedEffect& effect) { return is_same(effect, injected); });
  return found == trace.accepted.end() ? nullptr : &*found;
}

// Signs are a convention of the place (which way an axis points); sizes are compared without.
bool size_is_right(const TracedEffect& found, const InjectedEffect& injected) {
  const double truth = std::abs(injected.size);
  const double low = std::min(std::abs(found.interval.low), std::abs(found.interval.high));
  const double high = std::max(std::abs(found.interval.low), std::abs(found.interval.high));
  const bool zero_inside = found.interval.low <= 0.0 && found.interval.high >= 0.0;
  return std::abs(std::abs(found.size) - truth) <= 0.1 * truth ||
         ((zero_inside || low <= truth) && truth <= high);
}

bool named_as_ambiguous(const Trace& trace, const std::vector<InjectedEffect>& injected) {
  return std::ranges::any_of(trace.ambiguities, [&](const Ambiguity& ambiguity) {
    return std::ranges::any_of(ambiguity.effects, [&](const EffectId& id) {
      return std::ranges::any_of(injected,
                                 [&](const InjectedEffect& effect) { return is_at(id, effect); });
    });
  });
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

double percent(int part, int whole) { return whole == 0 ? 0.0 : 100.0 * part / whole; }

}  // namespace

std::string answer_of(const Trace& trace) {
  std::string out;
  for (const TracedEffect& effect : trace.accepted) {
    out += fmt::format("{}{} {} {:.4g}", out.empty() ? "" : " + ", effect.id.effect,
                       effect.id.place, effect.size);
    if (!effect.scan_words.empty()) {
      out += fmt::format(" ({})", effect.scan_words);
    } else if (!effect.scan_name.empty()) {
      out += fmt::format(" ({:.3g})", effect.scan);
    }
  }
  if (out.empty()) return std::string(to_string(trace.verdict));
  if (trace.verdict != TraceVerdict::kEffects)
    out += fmt::format(" ({})", to_string(trace.verdict));
  for (const Ambiguity& ambiguity : trace.ambiguities) {
    out += "; or";
    for (std::size_t k = 1; k < ambiguity.effects.size(); ++k)
      out += fmt::format(" {} {}", ambiguity.effects[k].effect, ambiguity.effects[k].place);
  }
  return out;
}

TraceJudgement judge_trace(const Trace& trace, const std::vector<InjectedEffect>& injected,
                           const Trace& clean_twin) {
  TraceJudgement out;
  out.answer = answer_of(trace);
  out.first = trace.accepted.empty() ? std::string(to_string(trace.verdict))
                                     : trace.accepted.front().id.effect;
  for (const InjectedEffect& effect : injected) {
    if (trace.accepted.empty()) continue;
    const TracedEffect& first = trace.accepted.front();
    out.named = out.named || first.id.effect == effect.effect;
    out.placed = out.placed || is_same(first, effect);
  }
  out.complete = true;
  for (const InjectedEffect& effect : injected) {
    const TracedEffect* found = find(trace, effect);
    out.complete = out.complete && found != nullptr;
    if (found != nullptr) out.sized = out.sized.value_or(true) && size_is_right(*found, effect);
  }
  out.exact = out.complete && trace.accepted.size() == injected.size() &&
              trace.verdict == TraceVerdict::kEffects;
  out.ambiguous = !out.complete && named_as_ambiguous(trace, injected);
  out.ratio = clean_twin.held_out_after.value > 0.0
                  ? trace.held_out_after.value / clean_twin.held_out_after.value
                  : 0.0;
  return out;
}

void TraceScore::add(const TraceJudgement& j) {
  ++count;
  named += j.named ? 1 : 0;
  placed += j.placed ? 1 : 0;
  complete += j.complete ? 1 : 0;
  exact += j.exact ? 1 : 0;
  ambiguous += j.ambiguous ? 1 : 0;
  if (j.sized) {
    ++sized_of;
    sized += *j.sized ? 1 : 0;
  }
  if (j.complete) ratios.push_back(j.ratio);
}

void TraceScore::add(const TraceScore& other) {
  count += other.count;
  named += other.named;
  placed += other.placed;
  complete += other.complete;
  exact += other.exact;
  ambiguous += other.ambiguous;
  sized += other.sized;
  sized_of += other.sized_of;
  ratios.insert(ratios.end(), other.ratios.begin(), other.ratios.end());
}

std::string TraceScore::heading() {
  return fmt::format("{:>4} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}", "n", "named", "place",
                     "all", "exact", "either", "size", "ratio", "worst");
}

std::string TraceScore::line() const {
  const double worst = ratios.empty() ? 0.0 : *std::ranges::max_element(ratios);
  return fmt::format("{:4} {:6.1f} {:6.1f} {:6.1f} {:6.1f} {:6.1f} {:6.1f} {:6.3f} {:6.3f}", count,
                     percent(named, count), percent(placed, count), percent(complete, count),
                     percent(exact, count), percent(ambiguous, count), percent(sized, sized_of),
                     median(ratios), worst);
}

void Confusion::add(const std::string& injected, const std::string& answered) {
  ++counts_[injected][answered];
}

void Confusion::print() const {
  for (const auto& [injected, answers] : counts_) {
    fmt::print("  {:16} ->", injected);
    for (const auto& [answered, count] : answers) fmt::print("  {} {}", answered, count);
    fmt::print("\n");
  }
}

}  // namespace kinescope
