// SPDX-License-Identifier: Apache-2.0
#include "app/capture/live_capture.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/capture/joint_feed.h"
#include "app/capture/page.h"
#include "app/capture/server.h"
#include "app/explain/families_in_video.h"
#include "calib/vision/live_camera.h"
#include "calib/vision/tag_detector.h"

namespace kinescope {
namespace {

constexpr int kRecordedQuality = 95;  // of JPEG
constexpr int kShownQuality = 70;

/// What the threads share.
class Shared {
 public:
  Shared(const CaptureRequest& request, std::string stamps)
      : declared_{request.head.markers, request.head.camera.has_value(),
                  request.joints.has_value()} {
    status_.source = without_password(request.source);
    status_.folder = request.folder.string();
    status_.family = request.head.markers.family;
    status_.stamps = std::move(stamps);
  }

  std::atomic<bool> start = false;  // pressed
  std::atomic<bool> stop = false;

  void begin(double at_s) {
    const std::scoped_lock lock(mutex_);
    status_.phase = "recording";
    status_.guide = {};
    begin_s_ = at_s;
  }
  void end(const std::string& why) {
    const std::scoped_lock lock(mutex_);
    status_.phase = "ended";
    status_.end = why;
  }
  void set_recorded(int frames, double seconds) {
    const std::scoped_lock lock(mutex_);
    status_.recorded = frames;
    status_.seconds = seconds;
  }
  void warn(const std::string& text) {
    const std::scoped_lock lock(mutex_);
    status_.warnings.push_back(text);
  }
  void set_family(const std::string& family) {
    const std::scoped_lock lock(mutex_);
    status_.family = family;
    declared_.markers.family = family;
  }
  void add_seen(double stamp_s, FrameView view, std::vector<std::uint8_t> jpeg) {
    const std::scoped_lock lock(mutex_);
    if (stamp_s >= begin_s_) add_frame(status_.guide, view);
    now_ = std::move(view);
    jpeg_ = std::move(jpeg);
  }
  void add_joints(const std::vector<std::string>& names, const std::vector<JointRow>& rows,
                  const std::string& stamps) {
    const std::scoped_lock lock(mutex_);
    for (const JointRow& row : rows) add_joint_values(status_.guide, names, row.values);
    status_.joint_stamps = stamps;
  }

  [[nodiscard]] CaptureStatus status() const {
    const std::scoped_lock lock(mutex_);
    CaptureStatus out = status_;
    out.missing = what_is_missing(out.guide, declared_);
    return out;
  }
  [[nodiscard]] std::string family() const {
    const std::scoped_lock lock(mutex_);
    return status_.family;
  }
  /// All but the first `passed`.
  [[nodiscard]] std::vector<std::string> warnings_behind(std::size_t passed) const {
    const std::scoped_lock lock(mutex_);
    return {status_.warnings.begin() + static_cast<std::ptrdiff_t>(passed), status_.warnings.end()};
  }
  /// For the page, which asks for the picture after it.
  [[nodiscard]] std::string state() {
    const CaptureStatus shown = status();
    FrameView now;
    {
      const std::scoped_lock lock(mutex_);
      now = now_;
      shown_ = jpeg_;  // the picture that goes with these outlines
    }
    if (shown.phase == "ended") end_was_shown = true;
    return live_json(shown, now).dump();
  }
  [[nodiscard]] std::vector<std::uint8_t> picture() const {
    const std::scoped_lock lock(mutex_);
    return shown_;
  }
  std::atomic<bool> end_was_shown = false;

 private:
  mutable std::mutex mutex_;
  CaptureStatus status_;
  Declared declared_;
  double begin_s_ = 0.0;
  FrameView now_;
  std::vector<std::uint8_t> jpeg_;
  std::vector<std::uint8_t> shown_;
};

/// Looks for markers in the newest frame, in a thread of its own.
class Examiner {
 public:
  Examiner(Shared& shared, const CaptureRequest& request)
      : shared_(shared),
        family_(request.head.markers.family),
        find_family_(request.find_family),
        pictures_(request.port.has_value()),
        thread_([this] { work(); }) {}
  ~Examiner() { finish(); }
  Examiner(const Examiner&) = delete;
  Examiner& operator=(const Examiner&) = delete;

  void show(LiveFrame frame) {
    const std::scoped_lock lock(mutex_);
    newest_ = std::move(frame);
    ready_.notify_one();
  }
  /// After the frame that waits.
  void finish() {
    {
      const std::scoped_lock lock(mutex_);
      finished_ = true;
      ready_.notify_one();
    }
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::optional<LiveFrame> wait() {
    std::unique_lock lock(mutex_);
    ready_.wait(lock, [this] { return newest_ || finished_; });
    return std::exchange(newest_, std::nullopt);
  }

  void work() {
    try {
      detector_ = make_tag_detector(family_);
      while (std::optional<LiveFrame> frame = wait()) look_at(*frame);
    } catch (const std::exception& error) {
      shared_.warn(fmt::format("the search for markers ended: {}", error.what()));
    }
  }

  void look_at(LiveFrame& frame) {
    const ImageView image = frame.image.view();
    FrameView view = look_at_frame(image, detector_->detect(image));
    if (!view.markers.empty()) find_family_ = false;
    shared_.add_seen(frame.stamp_s, std::move(view),
                     pictures_ ? jpeg_of(image, kShownQuality) : std::vector<std::uint8_t>());
    if (find_family_) look_for_family(frame);
  }

  // The robot may be out of view at first: every few seconds three frames are tried.
  void look_for_family(LiveFrame& frame) {
    constexpr double kApart_s = 0.7;
    constexpr std::size_t kTried = 3;
    if (!kept_.empty() && frame.stamp_s < kept_s_ + kApart_s) return;
    kept_s_ = frame.stamp_s;
    kept_.push_back(std::move(frame.image));
    if (kept_.size() < kTried) return;
    const std::vector<std::string> found = other_families(kept_, family_);
    kept_.clear();
    if (found.empty()) return;
    if (found.size() > 1) {
      shared_.warn(
          fmt::format("markers of {} are seen; those of {} are taken: choose with --family",
                      fmt::join(found, ", "), found.front()));
    }
    family_ = found.front();
    find_family_ = false;
    detector_ = make_tag_detector(family_);
    shared_.set_family(family_);
  }

  Shared& shared_;
  std::string family_;
  bool find_family_;
  bool pictures_;
  std::unique_ptr<TagDetector> detector_;
  std::vector<GreyImage> kept_;
  double kept_s_ = 0.0;
  std::mutex mutex_;
  std::condition_variable ready_;
  std::optional<LiveFrame> newest_;
  bool finished_ = false;
  std::thread thread_;
};

/// Receives joint values in a thread of its own, so that their stamps wait for no frame.
class JointReceiver {
 public:
  JointReceiver(Shared& shared, const std::string& name)
      : shared_(shared), source_(name), thread_([this] { work(); }) {}
  ~JointReceiver() {
    finished_ = true;
    thread_.join();
  }
  JointReceiver(const JointReceiver&) = delete;
  JointReceiver& operator=(const JointReceiver&) = delete;

  struct Received {
    std::vector<std::string> channels;
    std::string stamps;
    std::vector<JointRow> rows;
  };
  [[nodiscard]] Received take() {
    const std::scoped_lock lock(mutex_);
    return {channels_, stamps_, std::exchange(rows_, {})};
  }

 private:
  void work() {
    try {
      JointLines lines;
      lines.pass_over(source_.there_already());
      while (!finished_) {
        const std::string text = source_.wait();
        std::vector<JointRow> rows = lines.add(text, monotonic_s());
        for (const std::string& warning : lines.take_warnings()) shared_.warn(warning);
        const std::scoped_lock lock(mutex_);
        channels_ = lines.channels();
        stamps_ = lines.stamps();
        rows_.insert(rows_.end(), rows.begin(), rows.end());
      }
    } catch (const std::exception& error) {
      shared_.warn(error.what());
    }
  }

  Shared& shared_;
  JointSource source_;
  std::mutex mutex_;
  std::vector<std::string> channels_;
  std::string stamps_;
  std::vector<JointRow> rows_;
  std::atomic<bool> finished_ = false;
  std::thread thread_;
};

/// The thread that records.
class Session {
 public:
  Session(const CaptureRequest& request, const CaptureCalls& calls)
      : request_(request),
        calls_(calls),
        camera_(open_live_camera(request.source)),
        shared_(request, camera_->stamps()),
        written_family_(request.head.markers.family) {
    if (request.joints) joints_.emplace(shared_, *request.joints);
    if (request.port) {
      server_.emplace(CapturePage{.html = capture_page(without_password(request.source),
                                                       request.folder.string()),
                                  .state = [this] { return shared_.state(); },
                                  .picture = [this] { return shared_.picture(); },
                                  .start = [this] { shared_.start = true; },
                                  .stop = [this] { shared_.stop = true; }},
                      *request.port);
      if (calls_.page) calls_.page(fmt::format("http://127.0.0.1:{}/", server_->port()));
    }
    shared_.start = !request.port;
    examiner_.emplace(shared_, request);
  }

  CaptureOutcome run() {
    CaptureOutcome out;
    std::string why;
    try {
      while (why.empty()) why = step();
      if (recorder_) take_joints();
    } catch (const Error& error) {
      if (!recorder_) throw;  // nothing was begun
      out.failed = error;
      why = error.what();
    }
    examiner_->finish();
    shared_.end(why);
    pass_warnings();
    linger();
    out.status = shared_.status();
    // Stamps that turned out to be of another clock.
    out.status.stamps = camera_->stamps();
    return out;
  }

 private:
  /// One frame; why the recording ends, or nothing.
  std::string step() {
    std::optional<LiveFrame> frame = camera_->next();
    if (!frame) return "the source gives no further frame";
    if (calls_.interrupted && calls_.interrupted()) return "interrupted";
    if (shared_.stop) return "stopped";
    if (shared_.start && !recorder_) begin(frame->stamp_s);
    if (recorder_) {
      const double time_s = frame->stamp_s - begin_s_;
      if (request_.seconds && time_s >= *request_.seconds) return "the time is over";
      record(*frame, time_s);
    }
    pass_warnings();
    examiner_->show(std::move(*frame));
    return {};
  }

  void begin(double stamp_s) {
    begin_s_ = stamp_s;
    recorder_.emplace(request_.folder, request_.head);
    if (joints_) static_cast<void>(joints_->take());  // of the time before
    shared_.begin(stamp_s);
  }

  void record(const LiveFrame& frame, double time_s) {
    // All of one size, or no reader takes them.
    if (recorder_->frames() == 0) size_ = {frame.image.width, frame.image.height};
    if (size_ != std::pair(frame.image.width, frame.image.height)) {
      throw bad_input(without_password(request_.source), "the picture changed its size",
                      "what was recorded before is kept; begin anew");
    }
    recorder_->add_frame(time_s, jpeg_of(frame.image.view(), kRecordedQuality));
    take_joints();
    take_family();
    shared_.set_recorded(recorder_->frames(), time_s);
    if (calls_.recorded) calls_.recorded(time_s);
  }

  void take_joints() {
    if (!joints_) return;
    JointReceiver::Received received = joints_->take();
    std::erase_if(received.rows, [&](const JointRow& row) { return row.stamp_s < begin_s_; });
    if (received.rows.empty()) return;
    recorder_->add_joints(received.channels, received.rows, begin_s_);
    shared_.add_joints(received.channels, received.rows, received.stamps);
  }

  void take_family() {
    if (!request_.find_family) return;
    MarkerSet markers = request_.head.markers;
    markers.family = shared_.family();
    if (markers.family == written_family_) return;
    recorder_->set_family(markers);
    written_family_ = markers.family;
  }

  void pass_warnings() {
    for (const std::string& warning : shared_.warnings_behind(warned_)) {
      ++warned_;
      if (calls_.warning) calls_.warning(warning);
    }
  }

  /// Until the page has shown the end, or nobody looks at it.
  void linger() const {
    if (!server_) return;
    constexpr int kMost_ms = 2'000;  // some turns of the page's script
    constexpr int kTurn_ms = 50;
    for (int i = 0; i < kMost_ms / kTurn_ms && !shared_.end_was_shown; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(kTurn_ms));
  }

  const CaptureRequest& request_;
  const CaptureCalls& calls_;
  std::unique_ptr<LiveCamera> camera_;
  Shared shared_;
  std::optional<JointReceiver> joints_;
  std::optional<Examiner> examiner_;
  std::optional<Recorder> recorder_;
  std::optional<CaptureServer> server_;  // ends before what it asks
  double begin_s_ = 0.0;
  std::pair<int, int> size_;
  std::string written_family_;
  std::size_t warned_ = 0;
};

}  // namespace

CaptureOutcome capture(const CaptureRequest& request, const CaptureCalls& calls) {
  return Session(request, calls).run();
}

}  // namespace kinescope
