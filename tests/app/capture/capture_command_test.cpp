// SPDX-License-Identifier: Apache-2.0
//
// The command end to end, with a film in place of the camera, played at its own speed.
#include <chrono>
#include <csignal>
#include <fstream>
#include <future>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/commands/capture.h"
#include "app/io/recording.h"
#include "calib/vision/live_camera.h"
#include "calib/vision/tag_detector.h"
#include "calib/vision/video.h"
#include "tests/app/capture/http_client.h"
#include "tests/app/commands/program.h"
#include "tests/truth/render.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

const fs::path kSample = fs::path(KINESCOPE_SOURCE_DIR) / "sample_videos" / "gantry_time_lag";
constexpr double kFrame_s = 1.0 / 30.0;  // of that film

fs::path new_place(const std::string& name) {
  const fs::path folder = truth::temporary_path(name);
  fs::remove_all(folder);
  return folder;
}

std::vector<std::string> words_of(const fs::path& folder) {
  return {"capture", (kSample / "video.mp4").string(), "-o",        folder.string(),
          "--tags",  (kSample / "tags.yaml").string(), "--no-page", "--quiet"};
}

std::vector<std::string> with(std::vector<std::string> words,
                              const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

Recording recording_in(const fs::path& folder) {
  RecordingPaths paths;
  paths.folder = folder;
  return read_recording(paths);
}

int lines_of(const fs::path& file) {
  std::ifstream in(file);
  int lines = 0;
  for (std::string line; std::getline(in, line);) ++lines;
  return lines;
}

/// Until the file has so many lines; false after ten seconds.
bool wait_for_lines(const fs::path& file, int lines) {
  for (int i = 0; i < 200 && lines_of(file) < lines; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  return lines_of(file) >= lines;
}

TEST(Capture, MakesARecordingThatIsRead) {
  const fs::path folder = new_place("capture_made");
  const Outcome outcome =
      run(with(words_of(folder),
               {"--seconds", "1.5", "--camera", (kSample / "camera.yaml").string(), "--json"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json result = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(result["end"], "the time is over");
  EXPECT_EQ(result["stamps"], "source");
  EXPECT_EQ(result["markers"].size(), 5U);
  const Recording recording = recording_in(folder);
  EXPECT_TRUE(recording.camera);
  const auto video = open_video(recording.video);
  std::vector<double> times_s;
  std::optional<VideoFrame> last;
  while (auto frame = video->next()) {
    times_s.push_back(frame->time_s);
    last = std::move(frame);
  }
  ASSERT_EQ(times_s.size(), 45U) << "every frame, however slow the search for markers is";
  EXPECT_EQ(result["frames"], 45);
  constexpr double kWritten_s = 2e-6;
  for (std::size_t i = 0; i < times_s.size(); ++i)
    EXPECT_NEAR(times_s[i], static_cast<double>(i) * kFrame_s, kWritten_s);
  const auto detector = make_tag_detector(recording.markers.family);
  EXPECT_EQ(detector->detect(value_of(last).image.view()).size(), 5U);
}

TEST(Capture, JointValuesAreOnTheClockOfTheFrames) {
  const fs::path folder = new_place("capture_joints");
  const fs::path pipe = new_place("joints_pipe");
  constexpr double kStep_s = 0.02;
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::thread sender([&] {
    const int file = ::open(pipe.c_str(), O_WRONLY);
    const auto send = [&](const std::string& text) {
      static_cast<void>(!::write(file, text.data(), text.size()));
    };
    send("time,arm,rest\n");
    wait_for_lines(folder / "images" / "times.csv", 5);
    for (int i = 0; i < 20; ++i) {
      std::this_thread::sleep_for(std::chrono::duration<double>(kStep_s));
      send(i == 9 ? "0,broken,1\n" : fmt::format("{:.3f},{},0.5\n", 1e6 + kStep_s * i, 0.1 * i));
    }
    ::close(file);
  });
  const Outcome outcome =
      run(with(words_of(folder), {"--seconds", "2", "--joints", pipe.string()}));
  sender.join();
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("line 11: 'broken' is no number"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.out.find("missing   channel 'rest' never changes"), std::string::npos)
      << outcome.out;
  const JointLog log = recording_in(folder).log;
  EXPECT_EQ(log.channels, (std::vector<std::string>{"arm", "rest"}));
  ASSERT_EQ(log.size(), 19U);
  EXPECT_GT(log.times_s.front(), 3 * kFrame_s) << "sent after that";
  EXPECT_LT(log.times_s.back(), 2.0);
  constexpr double kWritten_s = 2e-6;
  EXPECT_NEAR(log.times_s.back() - log.times_s.front(), 19 * kStep_s, kWritten_s)
      << "of the sender";
}

/// Two markers at rest, 5 s.
void write_film(const fs::path& file, const std::string& family) {
  const CameraModel camera{.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 160, .cy = 120};
  std::vector<PlacedMarker> markers;
  for (const int id : {1, 2}) {
    Pose pose;
    pose.translation = {0.08 * (2 * id - 3), 0.0, 0.4};
    markers.push_back({apriltag_art(family, id), pose, 0.06});
  }
  Rng rng(1);
  const GreyImage image = render_markers(camera, markers, {}, rng);
  cv::Mat picture(image.height, image.width, CV_8UC1,
                  const_cast<std::uint8_t*>(image.pixels.data()));
  cv::VideoWriter film(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10.0,
                       picture.size(), false);
  for (int i = 0; i < 50; ++i) film.write(picture);
}

TEST(Capture, FindsTheFamilyThatIsSeen) {
  const fs::path folder = new_place("capture_family");
  fs::create_directories(folder);
  write_film(folder / "film.avi", "tag25h9");
  const fs::path made = folder / "made";
  const Outcome outcome = run({"capture", (folder / "film.avi").string(), "-o", made.string(),
                               "--size", "0.06", "--no-page", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err << outcome.out;
  EXPECT_NE(outcome.out.find("the source gives no further frame"), std::string::npos);
  EXPECT_NE(outcome.out.find("  tag 2 "), std::string::npos) << outcome.out;
  const MarkerSet markers = read_marker_set(made / "tags.yaml");
  EXPECT_EQ(markers.family, "tag25h9");
  EXPECT_DOUBLE_EQ(markers.default_size_m, 0.06);
}

TEST(Capture, RefusesWhatCannotBe) {
  const fs::path folder = new_place("capture_refused");
  const std::string video = (kSample / "video.mp4").string();
  const std::string out = folder.string();
  expect_refusal({"capture", "/dev/video97", "-o", out, "--size", "0.04"}, ExitCode::kBadInput,
                 "/dev/video97: no such camera");
  expect_refusal({"capture", "nowhere.mp4", "-o", out, "--size", "0.04"}, ExitCode::kBadInput,
                 "nowhere.mp4: no such camera, stream or file");
  // Port 1 is nobody's; FFmpeg's own words would make it two lines.
  expect_refusal({"capture", "http://me:secret@127.0.0.1:1/", "-o", out, "--size", "0.04"},
                 ExitCode::kBadInput, "http://127.0.0.1:1/: no picture comes from it");
  expect_refusal({"capture", video, "-o", out}, ExitCode::kBadRequest, "--size");
  expect_refusal({"capture", video, "-o", out, "--size", "0.04", "--no-page", "--joints", "none"},
                 ExitCode::kBadInput, "none: joint values cannot be read");
  expect_refusal({"capture", video, "-o", kSample.string(), "--size", "0.04", "--force"},
                 ExitCode::kBadRequest, "the folder holds another recording");
  EXPECT_FALSE(fs::exists(folder / "images"));
}

TEST(Capture, KeepsARecordingThatIsThere) {
  const fs::path folder = new_place("capture_there");
  const auto words = with(words_of(folder), {"--seconds", "0.3"});
  ASSERT_EQ(run(words).code, 0);
  const int before = lines_of(folder / "images" / "times.csv");
  expect_refusal(words, ExitCode::kBadRequest, "holds a recording already");
  EXPECT_EQ(lines_of(folder / "images" / "times.csv"), before);
  EXPECT_EQ(run(with(words_of(folder), {"--seconds", "0.2", "--force"})).code, 0);
  EXPECT_LT(lines_of(folder / "images" / "times.csv"), before);
}

TEST(Capture, TheLinkOfACameraIsShownWithoutItsPassword) {
  EXPECT_EQ(without_password("rtsp://me:secret@10.0.0.2/a@b"), "rtsp://10.0.0.2/a@b");
  EXPECT_EQ(without_password("http://camera:80/x"), "http://camera:80/x");
  EXPECT_EQ(without_password("/dev/video0"), "/dev/video0");
}

/// The program itself, ended by a signal in the middle; its exit code, or minus the signal.
int ended_by(int signal, const fs::path& folder) {
  std::vector<std::string> words = words_of(folder);
  words.insert(words.begin(), KINESCOPE_PROGRAM);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    const int nowhere = ::open("/dev/null", O_WRONLY);
    ::dup2(nowhere, STDOUT_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  EXPECT_TRUE(wait_for_lines(folder / "images" / "times.csv", 10));
  ::kill(child, signal);
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

TEST(Capture, AnEndInTheMiddleLeavesARecording) {
  for (const int signal : {SIGINT, SIGKILL}) {
    const fs::path folder = new_place("capture_ended");
    EXPECT_EQ(ended_by(signal, folder), signal == SIGINT ? 0 : -SIGKILL);
    const auto video = open_video(recording_in(folder).video);
    int frames = 0;
    while (video->next()) ++frames;
    EXPECT_EQ(frames, lines_of(folder / "images" / "times.csv") - 1);
    EXPECT_GE(frames, 9);
  }
}

TEST(Capture, ThePagesButtonsBeginAndEndIt) {
  const fs::path folder = new_place("capture_buttons");
  std::promise<int> port;
  nlohmann::json result;
  const Console console{
      .json = true,
      .quiet = true,
      .result = [&](const std::string& text) { result = nlohmann::json::parse(text); },
      .warning =
          [&](const std::string& text) {
            const std::size_t at = text.find("127.0.0.1:");
            if (at != std::string::npos) port.set_value(std::stoi(text.substr(at + 10)));
          }};
  CaptureOptions options;
  options.source = (kSample / "video.mp4").string();
  options.output = folder;
  options.tags = kSample / "tags.yaml";
  std::future<ExitCode> ended =
      std::async(std::launch::async, [&] { return capture_command(options, console); });
  const int at = port.get_future().get();
  const auto state = [&] {
    const std::string answer = http_request(at, "GET", "/state", own_host(at));
    return nlohmann::json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
  };
  const auto wait_until = [&](auto&& reached) {
    for (int i = 0; i < 200 && !reached(); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
  };
  wait_until([&] { return state()["now"]["markers"].size() == 5U; });
  EXPECT_EQ(state()["phase"], "waiting");
  EXPECT_EQ(state()["now"]["markers"].size(), 5U);
  EXPECT_FALSE(fs::exists(folder / "images")) << "before the button";
  EXPECT_EQ(status_of(http_request(at, "POST", "/start", own_host(at))), 204);
  wait_until([&] { return state()["frames"] > 5; });
  EXPECT_EQ(state()["phase"], "recording");
  EXPECT_EQ(status_of(http_request(at, "POST", "/stop", own_host(at))), 204);
  EXPECT_EQ(ended.get(), ExitCode::kDone);
  EXPECT_EQ(result["end"], "stopped");
  EXPECT_EQ(lines_of(folder / "images" / "times.csv") - 1, result["frames"]);
}

}  // namespace
}  // namespace kinescope
