// SPDX-License-Identifier: Apache-2.0
//
// The page in a real browser: opened from disk, the 3-D view starts and no script fails.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "app/report/report.h"
#include "tests/app/report/count_of.h"
#include "tests/app/report/synthetic_run.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  std::array<char, 65536> buffer{};
  for (std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe); n > 0;
       n = fread(buffer.data(), 1, buffer.size(), pipe)) {
    text.append(buffer.data(), n);
  }
  pclose(pipe);
  return text;
}

std::string browser() {
  const std::string found =
      output_of("command -v chromium chromium-browser google-chrome 2>/dev/null");
  return found.substr(0, found.find('\n'));
}

/// The DOM after the scripts ran; the console's messages go to `console`.
std::string opened(const RunSummary& run, std::string& console, const std::string& fragment = "") {
  const std::filesystem::path folder = truth::temporary_path("report");
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "report.html") << report_html(run, "");
  const std::string log = (folder / "console.txt").string();
  const std::string dom = output_of(
      "timeout 90 " + browser() +
      " --headless --no-sandbox --disable-gpu --disable-quic --no-first-run "
      "--disable-background-networking"
      " --disable-component-update --disable-sync --enable-logging=stderr --v=0 --user-data-dir=" +
      (folder / "profile").string() + " --virtual-time-budget=4000 --dump-dom file://" +
      (folder / "report.html").string() + fragment + " 2>" + log);
  std::ifstream in(log);
  console.assign(std::istreambuf_iterator<char>(in), {});
  std::filesystem::remove_all(folder);
  return dom;
}

/// Messages of the page's own scripts; the graphics driver's remarks are not theirs.
std::string complaints(const std::string& console) {
  std::string found;
  std::istringstream lines(console);
  for (std::string line; std::getline(lines, line);) {
    const bool driver = line.find("WebGL") != std::string::npos;
    if (line.find(":CONSOLE:") != std::string::npos && !driver) found += line + '\n';
  }
  return found;
}

std::string root_element(const std::string& dom) {
  const std::size_t at = dom.find("<html");
  return at == std::string::npos ? dom.substr(0, 200) : dom.substr(at, dom.find('>', at) - at);
}

TEST(Browser, OpensFromDiskAndStartsTheView) {
  if (browser().empty()) GTEST_SKIP() << "no Chromium on this machine";
  for (const SyntheticRunOptions& options :
       {SyntheticRunOptions{}, SyntheticRunOptions{.kind = MeasurementKind::kPose},
        SyntheticRunOptions{.kind = MeasurementKind::kPoint, .nominal = true},
        SyntheticRunOptions{.robot = "</script><script>alert(1)</script>"}}) {
    std::string console;
    const std::string dom = opened(synthetic_run(options), console);
    const std::string root = root_element(dom);
    if (root.find("no-webgl") != std::string::npos) GTEST_SKIP() << "this Chromium has no WebGL";
    EXPECT_NE(root.find("data-viewer=\"running\""), std::string::npos) << root;
    EXPECT_EQ(root.find("data-viewer-error"), std::string::npos) << root;
    EXPECT_NE(dom.find("<canvas"), std::string::npos);
    EXPECT_NE(dom.find("class=\"cursor\""), std::string::npos);
    EXPECT_EQ(complaints(console), "");
  }
}

TEST(Browser, TheVideoFollowsTheView) {
  if (browser().empty()) GTEST_SKIP() << "no Chromium on this machine";
  RunSummary run = synthetic_run();
  const std::vector<double>& times_s = run.calibration.times_s;
  for (const std::size_t frame : {std::size_t{0}, times_s.size() / 2, times_s.size() - 1})
    run.film.push_back({times_s[frame], 640, 480, ""});
  std::string console;
  const std::string dom = opened(run, console);
  if (root_element(dom).find("no-webgl") != std::string::npos)
    GTEST_SKIP() << "this Chromium has no WebGL";
  const std::size_t shown = dom.find("class=\"shown\"");
  ASSERT_NE(shown, std::string::npos);
  EXPECT_LT(shown, dom.find("data-t=\"", dom.find("data-t=\"") + 1))
      << "the first, where it begins";
  EXPECT_EQ(complaints(console), "");
}

TEST(Browser, SectionsAreFoldedAndAnAddressOpensItsOwn) {
  if (browser().empty()) GTEST_SKIP() << "no Chromium on this machine";
  const RunSummary run = synthetic_run();
  const std::string plain = report_html(run, "");
  const int sections = count_of(plain, "<section id=");
  EXPECT_EQ(count_of(plain, "<details class=\"fold\""), 0) << "whole without scripts";
  std::string console;
  const std::string closed = opened(run, console);
  EXPECT_EQ(count_of(closed, "<details class=\"fold\">"), sections - 1) << "all but the verdict";
  EXPECT_EQ(complaints(console), "");
  const std::string at_one = opened(run, console, "#residuals");
  EXPECT_EQ(count_of(at_one, "<details class=\"fold\">"), sections - 2);
  EXPECT_EQ(count_of(at_one, "<section id=\"residuals\"><details class=\"fold\" open=\"\">"), 1);
  EXPECT_EQ(complaints(console), "");
}

TEST(Browser, AnEmptyRunOpensToo) {
  if (browser().empty()) GTEST_SKIP() << "no Chromium on this machine";
  std::string console;
  const std::string root = root_element(opened({}, console));
  EXPECT_NE(root.find("data-viewer=\"empty\""), std::string::npos) << root;
  EXPECT_EQ(complaints(console), "");
}

}  // namespace
}  // namespace kinescope
