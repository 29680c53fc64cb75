// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/not_found.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/trace/family.h"

namespace kinescope::trace {
namespace {

bool is_named(const EffectId& id, const Trace& trace) {
  return std::ranges::find(trace.accepted, id, &TracedEffect::id) != trace.accepted.end() ||
         std::ranges::any_of(trace.ambiguities, [&](const Ambiguity& a) {
           return std::ranges::find(a.effects, id) != a.effects.end();
         });
}

// The size of an effect that does as much as the one that was fitted. Where that is nothing but
// noise, its direction is an accident: one parameter alone, in the mean over those that count.
double typical_size(const Candidate& candidate, const Score& score) {
  if (candidate.size || score.theta.size() == 1) return std::abs(size_of(candidate, score.theta));
  double squares = 0.0;
  double counted = 0.0;
  for (Eigen::Index i = 0; i < score.theta.size(); ++i) {
    const double weight = candidate.size_weights[i];
    if (!(weight > 0.0) || !(score.of_one[i] > 0.0)) continue;
    squares += weight / (score.of_one[i] * score.of_one[i]);
    counted += 1.0;
  }
  return std::sqrt(squares / std::max(1.0, counted));
}

// Nobody overlooks an effect that large: from here on the recording is no test of it.
bool beyond_possible(const Candidate& candidate, const Score& score, double smallest_size) {
  const double size = std::abs(size_of(candidate, score.theta));
  if (!candidate.possible || !(size > 0.0)) return false;
  const Eigen::VectorXd theta = score.theta * (smallest_size / size);
  return !candidate.possible(theta) && !candidate.possible(-theta);
}

}  // namespace

std::vector<NotFoundEffect> not_found(const Stage& stage, const Trace& trace,
                                      const TraceOptions& options, double level) {
  std::vector<NotFoundEffect> out;
  for (const TestedMember& member : test_family(stage.system, stage.fit.candidates)) {
    const Candidate& candidate = stage.fit.candidates[member.index];
    if (is_named(candidate.id, trace)) continue;
    // A scan's best value is an accident where there is nothing; its middle is typical.
    const Score score =
        candidate.scan.empty()
            ? member.score
            : score_test(stage.system,
                         candidate.columns(candidate.scan[candidate.scan.size() / 2]));
    const bool hidden = score.hidden() || std::isinf(candidate.floor);
    NotFoundEffect missing{candidate.id, hidden, 0.0, candidate.size_unit, ""};
    if (missing.hidden) {
      missing.record = candidate.record;
    } else {
      // What lies below the sensor's own errors is not looked for.
      double least_size = 0.0;
      if (score.rms > 0.0) {
        const double floor = std::max(options.floor, candidate.floor);
        least_size = typical_size(candidate, score) *
                     std::max(floor / score.rms, options.noise_floor / score.noise_share);
      }
      missing.smallest_size = smallest_size(candidate, score, level / member.tests, least_size);
      if (beyond_possible(candidate, score, missing.smallest_size))
        missing = {candidate.id, true, 0.0, candidate.size_unit, candidate.record};
    }
    out.push_back(std::move(missing));
  }
  return out;
}

}  // namespace kinescope::trace
