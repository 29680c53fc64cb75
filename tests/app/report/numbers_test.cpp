// SPDX-License-Identifier: Apache-2.0
#include "app/report/numbers.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "kinematics/core/text.h"

namespace kinescope::report {
namespace {

TEST(Numbers, UncertaintyHasTwoDigitsAndTheValueItsPlace) {
  EXPECT_EQ(value_and_uncertainty(0.1234567, 0.0000123, Quantity::kLength), "123.457 ± 0.012");
  EXPECT_EQ(value_and_uncertainty(0.1, 0.0000996, Quantity::kLength), "100.00 ± 0.10");
  EXPECT_EQ(value_and_uncertainty(0.1234567, 0.0345, Quantity::kLength), "123 ± 34");
  EXPECT_EQ(value_and_uncertainty(-1e-9, 1e-5, Quantity::kLength), "0.000 ± 0.010");
  EXPECT_EQ(value_and_uncertainty(0.0123, 0.00042, Quantity::kDelay), "12.30 ± 0.42");
  EXPECT_EQ(value_and_uncertainty(std::nan(""), 0.1, Quantity::kLength), "n/a");
  EXPECT_EQ(value_and_uncertainty(0.5, std::nullopt, Quantity::kPlain), "0.50000");
}

TEST(Numbers, ConvertFromSi) {
  EXPECT_EQ(text_with_unit(std::numbers::pi / 2, Quantity::kAngle), "90.0°");
  EXPECT_EQ(text_with_unit(0.00125, Quantity::kLength), "1.25 mm");
  EXPECT_EQ(text_with_unit(0.07123, Quantity::kPixels), "0.0712 px");
  EXPECT_EQ(text_with_unit(0.5, Quantity::kPercent), "50.0 %");
  EXPECT_EQ(value_text(300, Quantity::kCount), "300");
  EXPECT_EQ(value_text(0.0, Quantity::kPixels), "0");
  EXPECT_EQ(value_text(1234.5, Quantity::kPlain), "1234");
  EXPECT_EQ(uncertainty_text(std::nullopt, Quantity::kAngle), "not determined");
}

TEST(Numbers, ProbabilityWithoutFalseCertainty) {
  EXPECT_EQ(probability_text(1.0), "> 0.999999");
  EXPECT_EQ(probability_text(0.9995), "0.999500");
  EXPECT_EQ(probability_text(0.5), "0.500");
  EXPECT_EQ(odds_text(std::log(37.0)), "37 : 1");
  EXPECT_EQ(odds_text(-std::log(4.0)), "1 : 4.0");
  EXPECT_EQ(odds_text(std::log(14765.0)), "15000 : 1");
  EXPECT_EQ(odds_text(20.0), "> 10⁶ : 1");
}

TEST(Html, EscapesAndRepairs) {
  EXPECT_EQ(escaped("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
  EXPECT_EQ(clean_text("ok \xc3\xa9"), "ok \xc3\xa9");
  EXPECT_EQ(clean_text("bad \xff!"), "bad \xef\xbf\xbd!");
  EXPECT_EQ(clean_text("cut \xe2\x82"), "cut \xef\xbf\xbd\xef\xbf\xbd");
  EXPECT_EQ(clean_text("overlong \xc0\xaf"), "overlong \xef\xbf\xbd\xef\xbf\xbd");
  EXPECT_EQ(clean_text(std::string_view("nul\0!", 5)), "nul !");
}

TEST(Html, WhatStandsBetweenBackticksIsCode) {
  EXPECT_EQ(with_code("say `a <b>` and `c`."), "say <code>a &lt;b&gt;</code> and <code>c</code>.");
  EXPECT_EQ(with_code("`open"), "<code>open</code>") << "no element stays open";
  EXPECT_EQ(with_code(""), "");
}

TEST(Html, ASectionFoldsAtItsTitleWithoutAScript) {
  EXPECT_EQ(folded("<section id=\"a\"><h2>A</h2>\n<p>x</p></section>\n"),
            "<section id=\"a\"><details class=\"fold tests\"><summary><h2>A</h2></summary>\n"
            "<p>x</p></details></section>\n");
  EXPECT_EQ(folded(""), "");
  EXPECT_EQ(folded_part("more", ""), "");
  EXPECT_EQ(folded_part("a < b", "<p>x</p>"),
            "<details class=\"tests\"><summary>a &lt; b</summary><p>x</p></details>\n");
}

TEST(Plot, TicksAreRound) {
  EXPECT_EQ(nice_ticks(0.0, 10.0, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(nice_ticks(1.0, 1.0, 5), std::vector<double>{});
  EXPECT_EQ(tick_label(0.30000000000000004, 0.1), "0.3");
  EXPECT_EQ(tick_label(-1e-17, 0.1), "0");
  EXPECT_EQ(tick_label(2.5, 0.5), "2.5");
  EXPECT_EQ(tick_label(200.0, 100.0), "200");
}

TEST(Plot, PlacesUpAndDown) {
  const Plot up("up", {.label = "x"}, {.label = "y"});
  EXPECT_GT(up.place({0, 0}).y(), up.place({0, 1}).y());
  const Plot down("down", {.label = "x"}, {.label = "y", .down = true});
  EXPECT_LT(down.place({0, 0}).y(), down.place({0, 1}).y());
  EXPECT_LT(down.place({0, 0}).x(), down.place({1, 0}).x());
}

}  // namespace
}  // namespace kinescope::report
