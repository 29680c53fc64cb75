// SPDX-License-Identifier: Apache-2.0
#include "app/report/report.h"

#include <cmath>
#include <cstdlib>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/app/report/count_of.h"
#include "tests/app/report/synthetic_run.h"

namespace kinescope {
namespace {

constexpr std::string_view kUrdf =
    "<robot name=\"bench_arm\">\n  <link name=\"base\"/>\n</robot>\n";

/// The page without its script elements: what a reader with scripts off sees.
std::string without_scripts(const std::string& html) {
  std::string out;
  std::size_t from = 0;
  for (std::size_t at = html.find("<script"); at != std::string::npos;
       at = html.find("<script", from)) {
    out += html.substr(from, at - from);
    from = html.find("</script>", at) + 9;
  }
  return out + html.substr(from);
}

/// Places of NaN and infinity in a JSON document, and of numbers that are neither.
void collect_bad_numbers(const nlohmann::json& value, const std::string& place,
                         std::vector<std::string>& bad) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) bad.push_back(place);
  if (value.is_structured()) {
    for (const auto& [key, inner] : value.items()) {
      collect_bad_numbers(inner, fmt::format("{}/{}", place, key), bad);
    }
  }
}

std::vector<SyntheticRunOptions> every_kind() {
  return {{},
          {.gear_error_rad = 0.002},
          {.kind = MeasurementKind::kPose},
          {.kind = MeasurementKind::kPoint, .nominal = true},
          {.log = false},
          {.kind = MeasurementKind::kPose, .frames = 8}};
}

TEST(Report, HasEverySectionWithScriptsOff) {
  const std::string page = without_scripts(report_html(synthetic_run(), kUrdf));
  for (const char* id : {"verdict", "identity", "data", "structure", "view", "parameters", "errors",
                         "residuals", "observability", "method", "reproduce", "licences"}) {
    EXPECT_EQ(count_of(page, "<section id=\"" + std::string(id) + "\""), 1) << id;
    EXPECT_EQ(count_of(page, "href=\"#" + std::string(id) + "\""), 1) << id;
  }
  for (const char* id :
       {"inputs-table",   "options-table",      "markers-table",        "channels-table",
        "rejected-table", "structure-table",    "axes-table",           "mounts-table",
        "camera-table",   "clock-table",        "intrinsics-table",     "parameters-table",
        "errors-table",   "errors-links-table", "errors-markers-table", "dependence-table",
        "weak-table",     "solver-table",       "times-table",          "residuals-image",
        "residuals-time", "residuals-joints",   "residuals-histogram"}) {
    EXPECT_EQ(count_of(page, "id=\"" + std::string(id) + "\""), 1) << id;
  }
  EXPECT_GE(count_of(page, "<svg class=\"plot\""), 8);
  // Three views, and the first of them where the 3-D view would be.
  EXPECT_EQ(count_of(page, "<svg class=\"view\""), 4);
  EXPECT_EQ(count_of(page, "<svg class=\"tree\""), 1);
  EXPECT_EQ(count_of(page, "<svg class=\"matrix\""), 1);
  EXPECT_NE(page.find("The MIT License"), std::string::npos);
  EXPECT_NE(page.find("&lt;robot name=&quot;bench_arm&quot;&gt;\n"), std::string::npos);
}

TEST(Report, PosesAndPointsHaveNoPixels) {
  for (const auto kind : {MeasurementKind::kPose, MeasurementKind::kPoint}) {
    const std::string page = without_scripts(report_html(synthetic_run({.kind = kind}), ""));
    EXPECT_EQ(page.find(" px"), std::string::npos);
    EXPECT_EQ(page.find("residuals-image"), std::string::npos);
    EXPECT_EQ(page.find("intrinsics-table"), std::string::npos);
    EXPECT_NE(page.find("residuals-time"), std::string::npos);
    EXPECT_EQ(page.find("id=\"urdf\""), std::string::npos);
  }
}

TEST(Report, SaysFirstWhatTheModelLacked) {
  RunSummary run = synthetic_run();
  EXPECT_EQ(report_html(run, "").find("<b>Residual</b>"), std::string::npos);
  run.trace = Trace{};
  run.trace->verdict = TraceVerdict::kEffects;
  run.trace->reason = "the model lacked backlash at arm3";
  const std::string corrected = report_html(run, "");
  EXPECT_NE(corrected.find("<dt>What the model lacked</dt><dd>The model lacked backlash at arm3."),
            std::string::npos);
  EXPECT_NE(corrected.find("<li class=\"light fair\"><span class=\"sign\">!</span><b>Residual</b>"),
            std::string::npos);
  run.trace->verdict = TraceVerdict::kClean;
  EXPECT_NE(report_html(run, "").find("<span class=\"sign\">✓</span><b>Residual</b> noise"),
            std::string::npos);
}

TEST(Report, ShowsNoNaN) {
  for (const SyntheticRunOptions& options : every_kind()) {
    RunSummary run = synthetic_run(options);
    run.calibration.observability.condition_number = std::nan("");
    run.calibration.held_out_rms = std::nan("");
    run.calibration.joint_values(3, 1) = std::nan("");
    run.calibration.covariance(2, 2) = std::nan("");
    const std::string page = without_scripts(report_html(run, kUrdf));
    EXPECT_FALSE(
        std::regex_search(page, std::regex("[^a-zA-Z](nan|NaN|inf|-inf|null|undefined)[^a-zA-Z]")));
    std::vector<std::string> bad;
    const nlohmann::json result = result_json(run);
    collect_bad_numbers(result, "", bad);
    EXPECT_TRUE(bad.empty()) << bad.front();
    EXPECT_TRUE(result.at("observability").at("condition_number").is_null());
  }
}

TEST(Report, NamesNoOutsideAddress) {
  const std::string page = report_html(synthetic_run(), kUrdf);
  std::map<std::string, int> addresses;
  const std::regex address("[a-z]+://[^ \"'`\\\\)]*");
  for (auto it = std::sregex_iterator(page.begin(), page.end(), address);
       it != std::sregex_iterator(); ++it) {
    ++addresses[it->str()];
  }
  addresses.erase("http://www.w3.org/1999/xhtml");
  addresses.erase("http://www.w3.org/2000/svg");
  EXPECT_TRUE(addresses.empty()) << addresses.begin()->first;
  EXPECT_EQ(page.find("src=\""), std::string::npos);
  EXPECT_EQ(page.find("@import"), std::string::npos);
  EXPECT_NE(page.find("default-src 'none'"), std::string::npos);
}

TEST(Report, HostileNamesStayText) {
  const std::string evil = "</script><script>alert(1)</script>\"'&<img src=x>\xff\xc3";
  RunSummary run = synthetic_run({.robot = evil, .second_channel = evil});
  run.warnings = {evil};
  run.command = evil;
  run.structure->runner_up = evil;
  run.calibration.parameters[0].name = evil;
  run.calibration.tree.links[1].name = evil + "1";
  run.errors = summarise_errors(run.calibration);
  const std::string page = report_html(run, evil);
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
  EXPECT_EQ(page.find("<img"), std::string::npos);
  EXPECT_EQ(count_of(page, "<script"), count_of(report_html(synthetic_run(), kUrdf), "<script"));
  EXPECT_EQ(count_of(page, "</script"), count_of(report_html(synthetic_run(), kUrdf), "</script"));
  EXPECT_NO_THROW(static_cast<void>(result_json(run).dump()));  // throws on invalid UTF-8
}

TEST(Report, SameInputSameBytes) {
  for (const SyntheticRunOptions& options : every_kind()) {
    const RunSummary run = synthetic_run(options);
    EXPECT_EQ(report_html(run, kUrdf), report_html(run, kUrdf));
    EXPECT_EQ(result_json(run).dump(), result_json(run).dump());
  }
}

/// What one shown number must agree with: the document's number in the shown unit, to half the last
/// digit.
void expect_shown(const nlohmann::json& result, const std::string& pointer, const std::string& unit,
                  const std::string& text) {
  const std::map<std::string, double> factors = {{"", 1.0},
                                                 {"px", 1.0},
                                                 {"mm", 1e3},
                                                 {"ms", 1e3},
                                                 {"s", 1.0},
                                                 {"%", 100.0},
                                                 {"°", 180.0 / std::acos(-1.0)}};
  ASSERT_TRUE(factors.contains(unit)) << unit;
  const nlohmann::json::json_pointer place(pointer);
  ASSERT_TRUE(result.contains(place)) << pointer;
  const double expected = result.at(place).get<double>() * factors.at(unit);
  char* end = nullptr;
  const double shown = std::strtod(text.c_str(), &end);
  ASSERT_NE(end, text.c_str()) << pointer << " shows '" << text << "'";
  const std::string digits(text.c_str(), static_cast<std::size_t>(end - text.c_str()));
  double half = 0.5;
  if (const std::size_t exponent = digits.find('e'); exponent != std::string::npos) {
    half *= std::pow(10.0, std::atof(digits.c_str() + exponent + 1));
  }
  if (const std::size_t point = digits.find('.'); point != std::string::npos) {
    half *=
        std::pow(10.0, -static_cast<double>(std::min(digits.find('e'), digits.size()) - point - 1));
  }
  EXPECT_NEAR(shown, expected, half * 1.001) << pointer << " shows '" << text << "'";
}

TEST(Report, TheDocumentDoesNotDependOnWhenAndHowItWasMade) {
  RunSummary run = synthetic_run(every_kind().front());
  const std::string first = result_json(run).dump();
  run.command = "kinescope run elsewhere --threads 2";
  for (StageTime& time : run.times) time.seconds *= 2.0;
  EXPECT_EQ(result_json(run).dump(), first);
}

TEST(Report, EveryNumberIsThatOfTheDocument) {
  for (const SyntheticRunOptions& options : every_kind()) {
    const RunSummary run = synthetic_run(options);
    const nlohmann::json result = result_json(run);
    const std::string page = report_html(run, kUrdf);
    const std::regex cell("data-key=\"([^\"]*)\" data-unit=\"([^\"]*)\">([^<]*)<");
    int numbers = 0;
    for (auto it = std::sregex_iterator(page.begin(), page.end(), cell);
         it != std::sregex_iterator(); ++it) {
      // Times stand in run.json: they are no result.
      if ((*it)[1].str().starts_with("/run/t")) continue;
      expect_shown(result, (*it)[1], (*it)[2], (*it)[3]);
      ++numbers;
    }
    EXPECT_GT(numbers, 200);
  }
}

TEST(Report, DocumentKeepsItsSchema) {
  const nlohmann::json result = result_json(synthetic_run());
  EXPECT_EQ(result.at("schema"), "kinescope.result");
  EXPECT_EQ(result.at("schema_version"), 1);
  for (const char* key : {"run", "verdict", "data", "structure", "calibration", "errors",
                          "residuals", "observability"}) {
    EXPECT_TRUE(result.contains(key)) << key;
  }
  const nlohmann::json& joint = result.at("calibration").at("joints").at(2);
  EXPECT_EQ(joint.at("name"), "q3");
  EXPECT_EQ(joint.at("type"), "prismatic");
  EXPECT_EQ(joint.at("parent"), "link2");
  EXPECT_TRUE(joint.at("position_expanded_m").is_null());
  EXPECT_DOUBLE_EQ(joint.at("direction_expanded_rad").get<double>(), 2.0 * 3 * 8e-5);
  EXPECT_TRUE(result_json(synthetic_run({.nominal = true})).at("structure").is_null());
}

TEST(Report, RollPitchYawAreThoseOfUrdf) {
  RunSummary run = synthetic_run();
  const double roll = 0.3, pitch = -0.5, yaw = 2.0;
  run.calibration.tree.markers[1].T_link_marker.rotation =
      Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  const nlohmann::json result = result_json(run);
  const nlohmann::json& rpy =
      result.at("calibration").at("markers").at(1).at("mount").at("rpy_rad");
  EXPECT_NEAR(rpy.at(0).get<double>(), roll, 1e-12);
  EXPECT_NEAR(rpy.at(1).get<double>(), pitch, 1e-12);
  EXPECT_NEAR(rpy.at(2).get<double>(), yaw, 1e-12);
}

TEST(Report, StaysSmall) {
  // 33 s at 30 frames a second, four markers: the 3-D view's data are thinned to 600 frames.
  constexpr std::size_t kMostBytes = 3'000'000;
  const std::string page = report_html(synthetic_run({.frames = 990}), kUrdf);
  EXPECT_LT(page.size(), kMostBytes);
}

TEST(Report, AnEmptyRunIsAReportToo) {
  RunSummary run;
  run.robot = "nothing";
  const std::string page = report_html(run, "");
  EXPECT_NE(page.find("not run"), std::string::npos);
  EXPECT_NE(page.find("No error can be given"), std::string::npos);
}

TEST(Report, NoiseBeyondTheDeclaredOneIsNoGreenLight) {
  RunSummary run = synthetic_run();
  run.trace = Trace{};
  run.trace->verdict = TraceVerdict::kClean;
  EXPECT_NE(report_html(run, "").find("noise, nothing else"), std::string::npos);
  run.calibration.sigma_scale = 2.2;
  const std::string html = report_html(run, "");
  EXPECT_EQ(html.find("noise, nothing else"), std::string::npos);
  EXPECT_NE(html.find("nothing known is left, but 2.2 times the expected noise"),
            std::string::npos);
}

TEST(Report, ParametersOfPosesShowNoZeros) {
  RunSummary run = synthetic_run();
  run.calibration.parameters.front().unit = "rad";
  run.calibration.parameters.front().value = 0.0;
  const std::string html = report_html(run, "");
  EXPECT_EQ(html.find("/calibration/parameters/0/value"), std::string::npos);
  EXPECT_NE(html.find("/calibration/parameters/0/expanded"), std::string::npos);
}

TEST(Report, ChannelsHaveTheRangeWhileFilmed) {
  RunSummary run = synthetic_run();
  run.log.times_s.push_back(run.calibration.times_s.back() + 100.0);
  run.log.values.conservativeResize(run.log.values.rows() + 1, Eigen::NoChange);
  run.log.values.bottomRows(1).setConstant(77.0);
  const nlohmann::json channel = result_json(run).at("data").at("channels").at(0);
  EXPECT_EQ(channel.at("max"), 77.0);
  EXPECT_LT(channel.at("filmed_max"), 77.0);
  EXPECT_EQ(channel.at("filmed_min"), channel.at("min"));
}

}  // namespace
}  // namespace kinescope
