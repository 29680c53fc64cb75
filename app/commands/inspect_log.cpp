// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/inspection.h"
#include "app/explain/log_doubts.h"
#include "app/explain/recording_advice.h"
#include "kinematics/core/median.h"
#include "kinematics/log/exchanged_readings.h"
#include "kinematics/log/readings_apart.h"

namespace kinescope {
namespace {

constexpr double kLongGapS = 0.5;     ///< longer gaps are not bridged by the interpolation
constexpr double kUnevenShare = 0.5;  ///< of the mean step

ChannelFacts look_at_channel(const JointLog& log, Eigen::Index channel,
                             const RecordingSettings& settings, std::vector<Finding>& findings) {
  const Eigen::VectorXd values = log.values.col(channel);
  ChannelFacts facts{.name = log.channels[static_cast<std::size_t>(channel)], .unit = {}};
  const ChannelSpan span{values.minCoeff(), values.maxCoeff(),
                         (values.array() == values.array().round()).all()};
  facts.lower = span.lower;
  facts.upper = span.upper;
  const auto declared = settings.units.find(facts.name);
  facts.unit = declared == settings.units.end() ? guess_unit(span) : declared->second;
  facts.moves = span.moves();
  if (auto advice = channel_advice(facts.name, facts.unit, span))
    findings.push_back({false, std::move(*advice)});
  return facts;
}

void look_at_steps(const JointLog& log, LogFacts& facts, std::vector<Finding>& findings) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < log.size(); ++i) {
    if (log.is_joined_between(log.times_s[i - 1], log.times_s[i])) continue;
    steps.push_back(log.times_s[i] - log.times_s[i - 1]);
    if (steps.back() <= facts.longest_gap_s) continue;
    facts.longest_gap_s = steps.back();
    facts.longest_gap_at_s = log.times_s[i - 1];
  }
  // Gaps are told apart from the steps, or one of them would be all the jitter.
  const double longest_step_s = std::max(kLongGapS, 3.0 * median_of(steps));
  std::erase_if(steps, [&](double step) { return step > longest_step_s; });
  const auto count = static_cast<double>(steps.size());
  const double step = std::accumulate(steps.begin(), steps.end(), 0.0) / count;
  facts.rate_hz = 1.0 / step;
  for (const double other : steps) facts.jitter_s += std::abs(other - step) / count;
  if (facts.jitter_s > kUnevenShare * step) {
    findings.push_back(
        {false, fmt::format("the log's steps are uneven ({:.1f} ms around {:.1f} ms): are "
                            "its times those of the measurement?",
                            1e3 * facts.jitter_s, 1e3 * step)});
  }
}

/// One note for all channels of the kind: a robot's joints are logged in one unit.
void note_units(const std::vector<ChannelFacts>& channels, std::vector<Finding>& findings) {
  std::vector<std::string> quoted, units;
  double lower = 0.0;
  double upper = 0.0;
  for (const ChannelFacts& facts : channels) {
    if (facts.unit != "deg or mm?") continue;
    lower = quoted.empty() ? facts.lower : std::min(lower, facts.lower);
    upper = quoted.empty() ? facts.upper : std::max(upper, facts.upper);
    quoted.push_back(fmt::format("'{}'", facts.name));
    units.push_back(facts.name + ": deg");
  }
  if (quoted.empty()) return;
  const bool one = quoted.size() == 1;
  findings.push_back(
      {false, fmt::format("channel{} {} look{} like degrees or mm ({:.1f} to {:.1f}): declare "
                          "units: {{{}}} in recording.yaml, mm in place of deg for a joint that "
                          "slides; the scale of what is not declared is estimated",
                          one ? "" : "s", fmt::join(quoted, ", "), one ? "s" : "", lower, upper,
                          fmt::join(units, ", "))});
}

// `run` judges them by the markers.
void note_readings_apart(const JointLog& log, const std::vector<ReadingApart>& apart,
                         std::vector<Finding>& findings) {
  for (const std::vector<ReadingApart>& readings : told_together(apart)) {
    findings.push_back(
        {false, fmt::format("{}: `run` puts {} aside unless the markers say the same",
                            words_of(log, readings), readings.size() > 1 ? "them" : "it")});
  }
}

void note_exchanged(const JointLog& log, const std::vector<ReadingApart>& apart,
                    std::vector<Finding>& findings) {
  for (const ExchangedReadings& exchanged : exchanged_readings(log, apart)) {
    findings.push_back({false, fmt::format("{}: `run` takes it so unless the markers say otherwise",
                                           words_of(log, exchanged))});
  }
}

}  // namespace

LogFacts look_at_log(const JointLog& log, const RecordingSettings& settings,
                     std::vector<Finding>& findings) {
  LogFacts facts;
  facts.samples = static_cast<int>(log.size());
  facts.first_s = log.times_s.front();
  facts.last_s = log.times_s.back();
  if (log.size() > 1) look_at_steps(log, facts, findings);
  if (log.size() < 10) {
    findings.push_back({false, fmt::format("the log holds {} samples only", log.size())});
  }
  // One wild reading is no range, and says nothing of the unit.
  const std::vector<ReadingApart> apart = readings_apart(log);
  const JointLog calm = without_readings(log, apart);
  note_readings_apart(log, apart, findings);
  note_exchanged(log, apart, findings);
  for (Eigen::Index c = 0; c < log.values.cols(); ++c) {
    facts.channels.push_back(look_at_channel(calm, c, settings, findings));
  }
  note_units(facts.channels, findings);
  for (std::string& words : clock_jump_words(log)) findings.push_back({false, std::move(words)});
  const bool continuous = facts.rate_hz > 1.0 / kLongGapS;
  if (continuous && facts.longest_gap_s > kLongGapS) {
    findings.push_back(
        {false, fmt::format("the log has a gap of {:.2f} s behind t = {:.3f} s: frames in it "
                            "are not used",
                            facts.longest_gap_s, facts.longest_gap_at_s)});
  }
  return facts;
}

}  // namespace kinescope
