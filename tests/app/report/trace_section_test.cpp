// SPDX-License-Identifier: Apache-2.0
#include "app/report/trace_section.h"

#include <gtest/gtest.h>

#include "app/report/trace_json.h"
#include "app/report/trace_lines.h"
#include "app/report/trace_words.h"

namespace kinescope::report {
namespace {

// Something is left over the image: two nodes that the data show, one that they do not.
Trace trace_with_a_field() {
  Rest rest;
  rest.place = "camera";
  rest.unit = "px";
  rest.covariate = "place in the image";
  rest.covariate_unit = "px";
  rest.explained = 0.8;
  rest.field.at.resize(3, 2);
  rest.field.at << 100.0, 50.0, 120.0, 50.0, 100.0, 70.0;
  rest.field.mean.resize(3, 2);
  rest.field.mean << 0.3, 0.0, 0.0, -0.2, 0.1, 0.1;
  rest.field.sigma = Eigen::MatrixX2d::Constant(3, 2, 0.02);
  rest.field.sigma.row(2).setConstant(0.5);
  rest.field.spacing = 20.0;
  rest.held_out_before = {0.15, {0.14, 0.16}, "px"};
  rest.held_out_after = {0.05, {0.04, 0.06}, "px"};
  Trace trace;
  trace.verdict = TraceVerdict::kUnknown;
  trace.reason = "structure is left at camera, over place in the image";
  trace.rest = {rest};
  trace.held_out_before = rest.held_out_before;
  trace.held_out_after = rest.held_out_after;
  return trace;
}

std::size_t count(const std::string& text, const std::string& words) {
  std::size_t times = 0;
  for (auto at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++times;
  return times;
}

TEST(TraceSection, AFieldIsDrawnAsArrowsOverTheImage) {
  const std::string html = trace_section(trace_with_a_field());
  EXPECT_NE(html.find("Modelled as a field"), std::string::npos) << html;
  EXPECT_NE(html.find("follows the place in the image"), std::string::npos);
  EXPECT_NE(html.find("image row, px"), std::string::npos);
  EXPECT_NE(html.find("longest arrow"), std::string::npos);
  // One more arrow for every node.
  Trace fewer = trace_with_a_field();
  FieldMap& field = fewer.rest.front().field;
  for (Eigen::MatrixX2d* rows : {&field.at, &field.mean, &field.sigma})
    rows->conservativeResize(2, Eigen::NoChange);
  EXPECT_EQ(count(html, "<path class=\"line ") - count(trace_section(fewer), "<path class=\"line "),
            1U);
}

TEST(TraceSection, PicturesBeyondThoseOfAScreenAreFolded) {
  TracedEffect effect;
  effect.id = {"backlash", "j1"};
  effect.unit = "rad";
  effect.picture.covariate = "value of j1";
  effect.picture.covariate_unit = "rad";
  effect.picture.unit = "px";
  effect.picture.at = Eigen::VectorXd::LinSpaced(400, 0.0, 1.0);
  effect.picture.before = effect.picture.at;
  effect.picture.after = effect.picture.effect = Eigen::VectorXd::Zero(400);
  Trace trace;
  trace.verdict = TraceVerdict::kEffects;
  trace.accepted.assign(3, effect);
  EXPECT_EQ(count(trace_section(trace), "The other "), 0U);
  trace.accepted.assign(5, effect);
  const std::string html = trace_section(trace);
  const std::size_t fold = html.find("<summary>The other 2 effects, before and after</summary>");
  ASSERT_NE(fold, std::string::npos);
  EXPECT_EQ(count(html.substr(0, fold), "<div class=\"figures pair\">"), 3U);
  EXPECT_EQ(count(html.substr(fold), "<div class=\"figures pair\">"), 2U);
}

// Curves and fields are drawn in the report and are in no other product.
TEST(TraceSection, TheHeadOfAnUnknownRestNamesTheEffectsAndTheModelThatIsExported) {
  Trace trace = trace_with_a_field();
  const std::string alone = trace_lines(trace).front();
  EXPECT_NE(alone.find("0.15 px → 0.05 px with a field for it"), std::string::npos) << alone;
  TracedEffect scale;
  scale.id = {"encoder_scale", "q2"};
  scale.unit = "";
  trace.accepted = {scale};
  trace.held_out_before = {0.4, {0.3, 0.5}, "px"};
  const std::string beside = trace_lines(trace).front();
  EXPECT_NE(beside.find("the model lacked encoder_scale at q2; beyond that structure is left"),
            std::string::npos)
      << beside;
  EXPECT_NE(beside.find("0.4 px → 0.15 px with the effects, 0.05 px"), std::string::npos) << beside;
}

TEST(TraceSection, SharesArePrintedInPerCent) {
  Trace trace = trace_with_a_field();
  TracedEffect effect;
  effect.id = {"encoder_scale", "q2"};
  effect.unit = "";
  effect.size = 0.02;
  effect.interval = {0.019, 0.021};
  trace.accepted = {effect};
  EXPECT_NE(trace_lines(trace)[1].find("2 (1.9 to 2.1) %"), std::string::npos)
      << trace_lines(trace)[1];
  // A coefficient is none.
  trace.accepted.front().id.effect = "lens_distortion";
  EXPECT_NE(trace_lines(trace)[1].find("0.02 (0.019 to 0.021);"), std::string::npos)
      << trace_lines(trace)[1];
}

TEST(TraceSection, SaysThatTracingBeginsWithoutTheClocksOffset) {
  Trace trace = trace_with_a_field();
  EXPECT_EQ(trace_lines(trace).front().find("held at 0"), std::string::npos);
  TracedEffect late;
  late.id = {"time_offset", "clock"};
  late.unit = "s";
  trace.accepted = {late};
  trace.rest.clear();
  trace.verdict = TraceVerdict::kEffects;
  trace.steps = {{0, "the model as it is", 0.0, trace.held_out_before},
                 {1, "time_offset at clock", 0.0, trace.held_out_after}};
  const std::string line = trace_lines(trace).front();
  EXPECT_NE(line.find("0.15 px (clock offset held at 0) → 0.05 px"), std::string::npos) << line;
  const std::string html = trace_section(trace);
  EXPECT_NE(html.find("the model as it is (clock offset held at 0): error"), std::string::npos);
  EXPECT_EQ(html.find("time_offset at clock (clock offset"), std::string::npos);
}

TEST(TraceSection, ACleanTraceGivesTheErrorOnUnseenDataAndNoOther) {
  Trace trace = trace_with_a_field();
  trace.verdict = TraceVerdict::kClean;
  trace.rest.clear();
  trace.noise = 0.0493;
  const std::string line = trace_lines(trace).front();
  EXPECT_NE(line.find("the error on unseen data, 0.05 px, is noise"), std::string::npos) << line;
  EXPECT_EQ(line.find("0.0493"), std::string::npos) << line;
}

TEST(TraceSection, LimitsHaveAUnitAndTwoDigits) {
  const auto limit = [](const char* effect, double size, const char* unit) {
    return limit_text(
        {.id = {effect, "q1"}, .hidden = false, .smallest_size = size, .unit = unit, .record = ""});
  };
  EXPECT_EQ(limit("encoder_scale", 0.0025266, ""), "0.25 %");
  EXPECT_EQ(limit("lens_distortion", 0.0033905, ""), "0.0034 (coefficient)");
  EXPECT_EQ(limit("coupling", 0.00064971, ""), "0.00065 of the other joint's motion");
  EXPECT_EQ(limit("tag_slip", 6.204e-5, "m"), "0.062 mm");
  EXPECT_EQ(limit("helical", 0.1213, "m/turn"), "121 mm/turn");
  EXPECT_EQ(limit("rolling_shutter", 6.677e-7, "s"), "0.67 µs");
}

TEST(TraceSection, AWobbleIsToldWithItsRunOut) {
  Trace trace = trace_with_a_field();
  TracedEffect wobble;
  wobble.id = {"axis_wobble", "q2"};
  wobble.unit = "rad";
  wobble.size = 1e-3;
  wobble.interval = {0.9e-3, 1.1e-3};
  wobble.values = {{{"tilt x", "rad"}, 1e-3, 0.0},
                   {{"tilt y", "rad"}, 0.0, 0.0},
                   {{"run-out x", "m"}, 3e-4, 0.0},
                   {{"run-out y", "m"}, 4e-4, 0.0}};
  trace.accepted = {wobble};
  EXPECT_NE(trace_lines(trace).at(1).find("°, run-out 0.5 mm;"), std::string::npos)
      << trace_lines(trace).at(1);
}

TEST(TraceSection, SizesGoToTheSecondDigitOfTheirInterval) {
  TracedEffect effect;
  effect.unit = "s";
  effect.size = -0.0399928;
  effect.interval = {-0.0400081, -0.0399775};
  EXPECT_EQ(size_words(effect), "-39.993 (-40.008 to -39.977) ms");
  effect.unit = "";
  EXPECT_EQ(size_words(effect), "-3.9993 (-4.0008 to -3.9977) %");
}

// Curves are no wider than the other plots, and paper has the tests.
TEST(TraceSection, CurvesAreHalfAPageWideAndTestsArePrinted) {
  const std::string html = trace_section(trace_with_a_field());
  EXPECT_NE(html.find("<figure class=\"half\">"), std::string::npos);
  EXPECT_NE(html.find("<details class=\"tests\">"), std::string::npos);
  EXPECT_EQ(html.find("<details>"), std::string::npos);
}

TEST(TraceSection, JsonNamesThePlaceAndHoldsTheField) {
  const auto written = trace_json(trace_with_a_field());
  const auto& rest = written.at("unexplained").at(0);
  EXPECT_EQ(rest.at("depends_on"), "place in the image");
  EXPECT_EQ(rest.at("field").at("at").size(), 3U);
  EXPECT_EQ(rest.at("field").at("mean").at(1).at(1), -0.2);
  EXPECT_EQ(rest.at("field").at("spacing"), 20.0);
  Trace curve = trace_with_a_field();
  curve.rest.front().field = {};
  EXPECT_FALSE(trace_json(curve).at("unexplained").at(0).contains("field"));
}

}  // namespace
}  // namespace kinescope::report
