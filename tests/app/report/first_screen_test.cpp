// SPDX-License-Identifier: Apache-2.0
//
// What a reader gets in ten seconds.
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/report/report.h"
#include "tests/app/report/count_of.h"
#include "tests/app/report/synthetic_run.h"

namespace kinescope {
namespace {

HeldOutError px(double value) { return {value, {0.9 * value, 1.1 * value}, "px"}; }

TracedEffect backlash(const std::string& place, double before, double after) {
  TracedEffect effect;
  effect.id = {"backlash", place};
  effect.size = 0.01;
  effect.interval = {0.0099, 0.0101};
  effect.unit = "rad";
  effect.held_out_before = px(before);
  effect.held_out_after = px(after);
  return effect;
}

RunSummary traced_run(TraceVerdict verdict) {
  RunSummary run = synthetic_run();
  run.trace = Trace{};
  run.trace->verdict = verdict;
  run.trace->held_out_before = run.trace->held_out_after = px(0.2);
  return run;
}

std::string first_screen_of(const RunSummary& run) {
  const std::string page = report_html(run, "");
  const std::size_t begin = page.find("<section id=\"verdict\">");
  return page.substr(begin, page.find("<dl class=\"verdict\">") - begin);
}

TEST(FirstScreen, SaysInOneSentenceWhatTheRobotIsAndWhatIsWrongWithIt) {
  EXPECT_TRUE(has(first_screen_of(synthetic_run()),
                  "<p class=\"headline\">3 joints in a chain (R R P).</p>"));
  EXPECT_TRUE(has(first_screen_of(traced_run(TraceVerdict::kClean)),
                  "(R R P), and nothing wrong with it that this recording shows.</p>"));
  RunSummary effects = traced_run(TraceVerdict::kEffects);
  effects.trace->accepted = {backlash("arm1", 0.5, 0.2), backlash("arm2", 0.3, 0.2)};
  EXPECT_TRUE(has(first_screen_of(effects),
                  "(R R P), corrected for backlash at arm1 and backlash at arm2.</p>"));
  RunSummary unknown = traced_run(TraceVerdict::kUnknown);
  unknown.trace->rest.resize(1);
  unknown.trace->rest.front().place = "arm2";
  EXPECT_TRUE(has(first_screen_of(unknown),
                  "(R R P); at arm2 something is left that no known effect explains.</p>"));
  EXPECT_TRUE(has(first_screen_of(traced_run(TraceVerdict::kUnknown)),
                  "(R R P); what is left is no noise, and no known effect explains it.</p>"));
}

TEST(FirstScreen, ShowsTheVideoWithMarkersAndResiduals) {
  RunSummary run = synthetic_run();
  EXPECT_FALSE(has(first_screen_of(run), "id=\"film\""));
  const std::vector<double>& times_s = run.calibration.times_s;
  for (const std::size_t frame : {std::size_t{0}, times_s.size() / 2, times_s.size() - 1})
    run.film.push_back({times_s[frame], 640, 480, "QUJD"});
  const std::string page = first_screen_of(run);
  EXPECT_TRUE(has(page, "viewBox=\"0 0 640 480\"")) << page;
  EXPECT_TRUE(has(page, "href=\"data:image/jpeg;base64,QUJD\""));
  EXPECT_TRUE(has(page, fmt::format("<svg class=\"shown\" data-t=\"{:.4f}\"", run.film[1].time_s)))
      << "the middle one, also without scripts";
  const std::string film = page.substr(page.find("id=\"film\""));
  EXPECT_TRUE(has(film, "<path d=\"M")) << "residual arrows";
  EXPECT_TRUE(has(film, "<polygon class=\"c0\" points=\""));
}

TEST(FirstScreen, WithoutAnAnswerSaysSo) {
  RunSummary run = synthetic_run();
  run.calibration.status = CalibrationStatus::kUndetermined;
  run.calibration.status_reason = "the axis of arm2 is not determined";
  EXPECT_TRUE(has(first_screen_of(run),
                  "<p class=\"headline\">No answer: the axis of arm2 is not determined.</p>"));
}

TEST(FirstScreen, ItsNumberIsHowExactlyTheLastLinkIsKnown) {
  const RunSummary run = traced_run(TraceVerdict::kClean);
  const std::string page = first_screen_of(run);
  EXPECT_EQ(count_of(page, "class=\"merit\""), 1);
  EXPECT_TRUE(has(page, "<p class=\"merit\"><b><span data-key=\"/tip/translation_expanded_m\""))
      << page;
  EXPECT_TRUE(has(page, "data-key=\"/tip/rotation_expanded_rad\"")) << page;
  EXPECT_TRUE(has(page, "how exactly the URDF says where the last link is: tag_7 on ")) << page;
  EXPECT_TRUE(has(page, "<p class=\"check\"><b><span data-key=\"/errors/all/held_out_m/rms\""));
  EXPECT_TRUE(has(page, "at postures that the fit has not seen, across the line of sight (95 %: "));
  EXPECT_FALSE(has(page, "what the model lacks comes on top"));
  EXPECT_TRUE(has(first_screen_of(traced_run(TraceVerdict::kUnknown)),
                  "what the model lacks comes on top"));
  EXPECT_FALSE(has(first_screen_of(synthetic_run()), "(95 %: ")) << "nothing measured it";
}

TEST(FirstScreen, WithoutATipItsNumberIsTheErrorOnUnseenPostures) {
  RunSummary run = synthetic_run();
  run.calibration.covariance.resize(0, 0);
  EXPECT_TRUE(has(first_screen_of(run),
                  "<p class=\"merit\"><b><span data-key=\"/errors/all/held_out_m/rms\""));
}

TEST(FirstScreen, SaysWhatWasRejectedAndWarnedOf) {
  RunSummary run = synthetic_run();
  run.rejected = {{"something covers a part of it", 4}, {"too small", 1}};
  run.warnings = {"joints.csv: 3 rows repeat their time"};
  const std::string page = first_screen_of(run);
  EXPECT_TRUE(has(page,
                  " sightings as outliers of the fit; 4 detections: something covers a part of "
                  "it; 1 detection: too small"))
      << page;
  EXPECT_TRUE(has(page, "<li>joints.csv: 3 rows repeat their time</li>")) << page;
  run.rejected.clear();
  run.warnings.clear();
  for (SightingResidual& sighting : run.calibration.residuals) sighting.used = true;
  EXPECT_FALSE(has(first_screen_of(run), "<b>Rejected</b>"));
}

TEST(FirstScreen, EffectsAreWordsAndCommandsAreCode) {
  RunSummary run = traced_run(TraceVerdict::kEffects);
  run.trace->accepted = {backlash("clock", 0.5, 0.2)};
  run.trace->accepted.front().id.effect = "time_offset";
  const std::string page = first_screen_of(run);
  EXPECT_TRUE(has(page, "corrected for time offset at clock.</p>")) << page;
  EXPECT_TRUE(has(page, "<code>kinescope plan</code>")) << page;
}

TEST(FirstScreen, BarsAreAsLongAsTheErrorsTheyStandFor) {
  RunSummary run = traced_run(TraceVerdict::kEffects);
  run.trace->accepted = {backlash("arm2", 0.25, 0.2), backlash("arm1", 0.5, 0.2)};
  const std::string page = first_screen_of(run);
  EXPECT_TRUE(has(page, "<i class=\"without\" style=\"width:55.0%\"></i><span>0.5 px without"));
  EXPECT_TRUE(has(page, "<i class=\"without\" style=\"width:27.5%\"></i><span>0.25 px without"));
  EXPECT_TRUE(has(page, "<i class=\"with\" style=\"width:22.0%\"></i><span>0.2 px with it"));
  EXPECT_LT(page.find("0.5 px"), page.find("0.25 px")) << "the largest first";
}

}  // namespace
}  // namespace kinescope
