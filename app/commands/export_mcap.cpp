// SPDX-License-Identifier: Apache-2.0
//
// A run as an MCAP file for viewers: frames, markers, joint values, residuals, effects.
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "app/commands/export_form.h"
#include "app/io/foxglove_json.h"
#include "app/io/json_text.h"
#include "app/io/output_folder.h"
#include "app/io/residuals_file.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kCameraFrame = "camera_optical_frame";
// Seconds of a message are 32 bits.
constexpr double kMostSeconds = 4294967295.0;

// Stamps in ns from a start that leaves none below zero.
class McapClock {
 public:
  McapClock(const std::vector<double>& times_s, const fs::path& source)
      : start_s_(std::floor(std::min(0.0, times_s.front()))) {
    if (times_s.back() - start_s_ < kMostSeconds) return;
    throw bad_input(source.string(),
                    fmt::format("t = {} s is beyond what a viewer's clock holds", times_s.back()),
                    "let the recording's times be in s");
  }
  [[nodiscard]] std::uint64_t at(double time_s) const {
    constexpr double kNanoseconds = 1e9;
    const double seconds = std::floor(time_s - start_s_);
    return static_cast<std::uint64_t>(seconds) * 1'000'000'000U +
           static_cast<std::uint64_t>(std::llround((time_s - start_s_ - seconds) * kNanoseconds));
  }
  [[nodiscard]] double start_s() const { return start_s_; }

 private:
  double start_s_ = 0.0;
};

bool is_known(const Pose& pose) {
  return pose.translation.allFinite() && pose.rotation.coeffs().allFinite();
}

// Gathers the messages of a run, channel by channel.
class McapOfRun {
 public:
  explicit McapOfRun(const RecordedRun& recorded)
      : recorded_(recorded),
        calibration_(recorded.run.calibration),
        clock_(recorded.joints.times_s, recorded.run.folder),
        first_ns_(clock_.at(recorded.joints.times_s.front())) {
    content_.library = "Kinescope " + program_version();
  }

  // What rests: markers on their links, a camera that stands still.
  void add_static_frames() {
    std::vector<foxglove::FrameTransform> transforms;
    for (const Marker& marker : calibration_.tree.markers)
      transforms.push_back({link_name(marker.link), tag_name(marker), marker.T_link_marker});
    if (!calibration_.moving)
      transforms.push_back(
          {link_name(LinkId{0}), kCameraFrame, calibration_.T_camera_base.inverse()});
    const std::size_t channel = add(foxglove::frame_transforms_channel("/tf_static"));
    say(channel, first_ns_, foxglove::frame_transforms(first_ns_, transforms));
  }

  void add_moving_frames() {
    const std::size_t channel = add(foxglove::frame_transforms_channel("/tf"));
    for (std::size_t f = 0; f < recorded_.joints.times_s.size(); ++f) {
      const std::vector<foxglove::FrameTransform> transforms = transforms_in(f);
      if (transforms.empty()) continue;
      const std::uint64_t now = stamp(f);
      say(channel, now, foxglove::frame_transforms(now, transforms));
    }
  }

  void add_markers() {
    std::vector<foxglove::Plate> plates;
    for (const Marker& marker : calibration_.tree.markers) {
      if (marker.size_m > 0.0)
        plates.push_back(
            {link_name(marker.link), tag_name(marker), marker.T_link_marker, marker.size_m});
    }
    const std::size_t channel = add(foxglove::scene_channel("/markers"));
    say(channel, first_ns_, foxglove::plates(first_ns_, plates));
  }

  void add_joints() {
    const std::size_t channel =
        add(foxglove::numbers_channel("/joint_values", "kinescope.JointValues", {"values"}));
    const KinematicTree& tree = calibration_.tree;
    for (std::size_t f = 0; f < recorded_.joints.times_s.size(); ++f) {
      json values = json::object();
      for (std::size_t j = 0; j < tree.joints.size(); ++j) {
        const double value =
            recorded_.joints.values(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(j));
        if (is_movable(tree.joints[j]) && std::isfinite(value)) values[tree.joints[j].name] = value;
      }
      say(channel, stamp(f), {{"timestamp", foxglove::timestamp(stamp(f))}, {"values", values}});
    }
  }

  void add_residuals(const FrameResiduals& residuals) {
    const std::string unit = residuals.in_px ? "px" : "m";
    const std::size_t channel =
        add(foxglove::numbers_channel("/residuals", "kinescope.Residuals", {"frame", "markers"}));
    for (const auto& [t, frame] : residuals.at) {
      if (!(t >= recorded_.joints.times_s.front() && t <= recorded_.joints.times_s.back()))
        continue;
      json numbers{{"used", frame.used}, {"rejected", frame.rejected}};
      if (frame.rms) numbers["rms_" + unit] = *frame.rms;
      if (frame.held_out_rms) numbers["held_out_rms_" + unit] = *frame.held_out_rms;
      json markers = json::object();
      for (const auto& [id, rms] : frame.of_id) markers[fmt::format("tag_{}", id)] = rms;
      const std::uint64_t now = clock_.at(t);
      say(channel, now,
          {{"timestamp", foxglove::timestamp(now)}, {"frame", numbers}, {"markers", markers}});
    }
  }

  // Of lenses that viewers know; the camera's images are not in the file.
  void add_camera() {
    const CameraModel& c = calibration_.camera;
    if (calibration_.kind != MeasurementKind::kCorners || c.width <= 0 ||
        c.model == DistortionModel::kEquidistant)
      return;
    json terms = json::array();
    for (int i = 0; i < distortion_count(c.model); ++i)
      terms.push_back(c.distortion[static_cast<std::size_t>(i)]);
    const std::size_t channel = add(foxglove::camera_calibration_channel("/camera/calibration"));
    say(channel, first_ns_,
        {{"timestamp", foxglove::timestamp(first_ns_)},
         {"frame_id", kCameraFrame},
         {"width", c.width},
         {"height", c.height},
         {"distortion_model", std::string(to_string(c.model))},
         {"D", terms},
         {"K", {c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0}},
         {"R", {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}},
         {"P", {c.fx, 0.0, c.cx, 0.0, 0.0, c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0}}});
  }

  // What the run says beside the numbers, at the beginning.
  void add_log() {
    const std::size_t channel = add(foxglove::log_channel("/log"));
    const auto tell = [&](const std::string& text) {
      say(channel, first_ns_, foxglove::log_message(first_ns_, text));
    };
    tell(fmt::format(
        "times: s of the recording's frames on the camera's clock{}",
        clock_.start_s() < 0.0 ? fmt::format(", {} s later", -clock_.start_s()) : std::string()));
    if (!recorded_.run.trace) return tell("effects were not looked for");
    for (const StoredEffect& found : recorded_.run.trace->found) {
      tell(fmt::format("{} at {}: {:.4g} {} (standard uncertainty {:.2g})", found.effect,
                       found.place, found.size, found.unit, found.sigma));
    }
    if (recorded_.run.trace->found.empty()) tell("no effect was found");
  }

  [[nodiscard]] const bags::McapContent& content() const { return content_; }

 private:
  std::size_t add(bags::McapChannel channel) {
    content_.channels.push_back(std::move(channel));
    return content_.channels.size() - 1;
  }
  void say(std::size_t channel, std::uint64_t now, const json& message) {
    content_.messages.push_back({channel, now, dumped(message, -1)});
  }
  [[nodiscard]] std::uint64_t stamp(std::size_t frame) const {
    return clock_.at(recorded_.joints.times_s[frame]);
  }
  [[nodiscard]] std::string link_name(LinkId link) const {
    return calibration_.tree.links[link.index()].name;
  }
  static std::string tag_name(const Marker& marker) {
    return fmt::format("tag_{}", marker.id.value);
  }

  [[nodiscard]] std::vector<foxglove::FrameTransform> transforms_in(std::size_t frame) const {
    std::vector<foxglove::FrameTransform> out;
    for (std::size_t j = 0; j < calibration_.tree.joints.size(); ++j) {
      const Joint& joint = calibration_.tree.joints[j];
      const double value =
          recorded_.joints.values(static_cast<Eigen::Index>(frame), static_cast<Eigen::Index>(j));
      const Pose T = joint.T_parent_joint * joint_motion(joint.type, joint.axis, value);
      if (is_known(T)) out.push_back({link_name(joint.parent), link_name(joint.child), T});
    }
    if (calibration_.moving && is_known(recorded_.T_base_camera[frame]))
      out.push_back({link_name(LinkId{0}), kCameraFrame, recorded_.T_base_camera[frame]});
    return out;
  }

  const RecordedRun& recorded_;
  const Calibration& calibration_;
  McapClock clock_;
  std::uint64_t first_ns_;
  bags::McapContent content_;
};

}  // namespace

ExportForm export_mcap(const ExportOptions& options) {
  const RecordedRun recorded = read_recorded_run(options.source, "--mcap");
  const fs::path residuals = options.source / "residuals.csv";
  std::vector<fs::path> inputs = recorded.inputs;
  inputs.push_back(residuals);
  require_new_file(options.mcap, "--mcap", inputs, options.force);
  McapOfRun run(recorded);
  run.add_static_frames();
  run.add_moving_frames();
  run.add_markers();
  run.add_joints();
  run.add_residuals(read_frame_residuals(residuals, recorded.run.calibration));
  run.add_camera();
  run.add_log();
  const bags::McapContent& content = run.content();
  json topics = json::object();
  for (std::size_t c = 0; c < content.channels.size(); ++c) {
    topics[content.channels[c].topic] = {
        {"schema", content.channels[c].schema_name},
        {"messages", std::ranges::count(content.messages, c, &bags::McapMessage::channel)}};
  }
  ExportForm out;
  out.files.push_back({options.mcap, bags::mcap_file(content)});
  out.result["mcap"] = {{"file", report::text(options.mcap.string())}, {"topics", topics}};
  out.lines = {fmt::format("mcap    {} ({} topics, {} messages)", options.mcap.string(),
                           content.channels.size(), content.messages.size())};
  return out;
}

}  // namespace kinescope
