// SPDX-License-Identifier: Apache-2.0
//
// The page and its server: who is answered, and what a real browser shows.
#include "app/capture/page.h"

#include <array>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/capture/capture_json.h"
#include "app/capture/server.h"
#include "calib/vision/live_camera.h"
#include "kinematics/core/error.h"
#include "tests/app/capture/http_client.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

struct Pressed {
  std::atomic<int> start = 0;
  std::atomic<int> stop = 0;
};

/// A capture of one marker, number 7, and a channel with a name that is a script.
CapturePage sample_page(Pressed& pressed) {
  CaptureStatus status;
  status.family = "tag36h11";
  FrameView view{.width = 64, .height = 48, .markers = {}};
  MarkerView marker{.tag = {}, .edge_px = 12.0, .tilt_deg = 20.0, .refusal = Refusal::kSmall};
  marker.tag.id = TagId{7};
  marker.tag.corners_px = {{10, 22}, {22, 22}, {22, 10}, {10, 10}};
  view.markers.push_back(marker);
  view.refusal = Refusal::kSmall;
  add_frame(status.guide, view);
  add_joint_values(status.guide, {"<script>alert(1)</script>"}, std::vector{0.5});
  status.missing = what_is_missing(status.guide, {});
  const GreyImage image{64, 48, std::vector<std::uint8_t>(std::size_t{64} * 48, 90)};
  return {.html = capture_page("camera", "arm"),
          .state = [status, view] { return live_json(status, view).dump(); },
          .picture = [image] { return jpeg_of(image.view(), 80); },
          .start = [&pressed] { ++pressed.start; },
          .stop = [&pressed] { ++pressed.stop; }};
}

TEST(CaptureServer, AnswersItsOwnPageAlone) {
  Pressed pressed;
  const CaptureServer server(sample_page(pressed), 0);
  const int port = server.port();
  const std::string own = own_host(port);
  const std::string other_port = fmt::format("Host: 127.0.0.1:{}\r\n", port - 1);
  EXPECT_EQ(status_of(http_request(port, "GET", "/state", own)), 200);
  EXPECT_EQ(status_of(http_request(port, "GET", "/picture.jpg", own)), 200);
  EXPECT_EQ(status_of(http_request(port, "GET", "/", own + "Sec-Fetch-Site: none\r\n")), 200);
  for (const std::string& headers :
       {std::string("Host: evil.example\r\n"), other_port, std::string(),
        own + "Origin: http://evil.example\r\n", own + "Origin: null\r\n",
        own + "Sec-Fetch-Site: cross-site\r\n", own + "Sec-Fetch-Site: same-site\r\n"}) {
    for (const char* path : {"/", "/state", "/picture.jpg"})
      EXPECT_EQ(status_of(http_request(port, "GET", path, headers)), 403) << path << headers;
    EXPECT_EQ(status_of(http_request(port, "POST", "/start", headers)), 403) << headers;
  }
  EXPECT_EQ(pressed.start, 0);
  EXPECT_EQ(status_of(http_request(port, "GET", "/start", own)), 404) << "no picture starts it";
  const std::string origin = fmt::format("Origin: http://127.0.0.1:{}\r\n", port);
  EXPECT_EQ(status_of(http_request(port, "POST", "/start", own + origin)), 204);
  EXPECT_EQ(status_of(http_request(port, "POST", "/stop", own)), 204);
  EXPECT_EQ(pressed.start, 1);
  EXPECT_EQ(pressed.stop, 1);
}

TEST(CaptureServer, ListensOnTheLoopbackInterfaceAlone) {
  Pressed pressed;
  const CaptureServer server(sample_page(pressed), 0);
  const std::string port = fmt::format(":{:04X}", server.port());
  int listeners = 0;
  for (const char* table : {"/proc/self/net/tcp", "/proc/self/net/tcp6"}) {
    std::ifstream lines(table);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string number, local, remote, state;
      words >> number >> local >> remote >> state;
      if (!local.ends_with(port) || state != "0A") continue;
      ++listeners;
      EXPECT_EQ(local, "0100007F" + port);
    }
  }
  EXPECT_EQ(listeners, 1);
}

TEST(CaptureServer, APortInUseIsRefused) {
  Pressed pressed;
  const CaptureServer server(sample_page(pressed), 0);
  try {
    const CaptureServer second(sample_page(pressed), server.port());
    FAIL() << "two on one port";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadRequest);
  }
}

std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  std::array<char, 65536> buffer{};
  for (std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe); n > 0;
       n = fread(buffer.data(), 1, buffer.size(), pipe))
    text.append(buffer.data(), n);
  pclose(pipe);
  return text;
}

TEST(CapturePage, ABrowserShowsMarkersAndWhatIsMissing) {
  std::string browser = output_of("command -v chromium chromium-browser google-chrome 2>/dev/null");
  browser = browser.substr(0, browser.find('\n'));
  if (browser.empty()) GTEST_SKIP() << "no Chromium on this machine";
  Pressed pressed;
  const CaptureServer server(sample_page(pressed), 0);
  const std::filesystem::path folder = truth::temporary_path("capture_page");
  std::filesystem::create_directories(folder);
  const std::string dom = output_of(fmt::format(
      "timeout 90 {} --headless --no-sandbox --disable-gpu --no-first-run "
      "--disable-background-networking --disable-component-update --disable-sync "
      "--enable-logging=stderr --v=0 --user-data-dir={}/profile --virtual-time-budget=3000 "
      "--dump-dom http://127.0.0.1:{}/ 2>{}/console.txt",
      browser, folder.string(), server.port(), folder.string()));
  std::stringstream console;
  console << std::ifstream(folder / "console.txt").rdbuf();
  EXPECT_NE(dom.find("data-capture=\"shown\""), std::string::npos) << dom.substr(0, 300);
  EXPECT_NE(dom.find("<td>tag 7</td>"), std::string::npos);
  EXPECT_NE(dom.find("class=\"refused\""), std::string::npos) << "its outline";
  EXPECT_NE(dom.find("This frame is refused: marker too small"), std::string::npos);
  EXPECT_NE(dom.find("<li>no marker is seen in 5 frames"), std::string::npos) << "what is missing";
  EXPECT_NE(dom.find("src=\"blob:"), std::string::npos) << "the picture";
  EXPECT_NE(dom.find("&lt;script&gt;alert(1)"), std::string::npos) << "a name is a text";
  EXPECT_EQ(console.str().find(":CONSOLE:"), std::string::npos) << console.str();
  std::filesystem::remove_all(folder);
}

TEST(CapturePage, LoadsNothingFromElsewhere) {
  const std::string page = capture_page("rtsp://camera/<b>", "arm");
  EXPECT_EQ(page.find("<b>"), std::string::npos);
  EXPECT_NE(page.find("default-src 'none'"), std::string::npos);
  for (const char* loading : {"src=\"", "href=\"http", "@import", "url("})
    EXPECT_EQ(page.find(loading), std::string::npos) << loading;
}

}  // namespace
}  // namespace kinescope
