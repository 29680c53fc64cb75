// SPDX-License-Identifier: Apache-2.0
#include "app/io/bag_files.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "calib/camera/camera_file.h"
#include "kinematics/bags/bag_contents.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// "36h11" and "tag36h11" are one family.
std::string_view without_tag(std::string_view family) {
  if (family.starts_with("tag")) family.remove_prefix(3);
  return family;
}

/// image_proc names rectified images so; detectors of markers look for markers in those
/// (apriltag_ros).
bool is_rectified(const bags::Contents& contents, const std::string& topic) {
  const bool detected =
      std::ranges::find(contents.detections, topic, &bags::DetectionSeries::topic) !=
      contents.detections.end();
  return detected || topic.find("/image_rect") != std::string::npos;
}

/// camera_info of ROS as the file has it (sensor_msgs/CameraInfo.msg: K and P are those of the
/// whole image; what is published is cut out of it, then binned).
std::string camera_text(const bags::CameraInfo& info, bool of_rectified) {
  const bool rectified = of_rectified && info.p[0] > 0.0;
  const double fx = rectified ? info.p[0] : info.k[0];
  const double cx = rectified ? info.p[2] : info.k[2];
  const double fy = rectified ? info.p[5] : info.k[4];
  const double cy = rectified ? info.p[6] : info.k[5];
  const double bin_x = std::max(1U, info.binning_x);
  const double bin_y = std::max(1U, info.binning_y);
  const bool cut_out = info.roi_width > 0 && info.roi_height > 0;
  const double width = cut_out ? info.roi_width : info.width;
  const double height = cut_out ? info.roi_height : info.height;
  const auto binned = [](double centre, double offset, double bin) {
    return (centre - offset + 0.5) / bin - 0.5;  // centres of pixels are whole numbers
  };
  std::string model =
      rectified || info.distortion_model.empty() ? "plumb_bob" : info.distortion_model;
  std::vector<double> d = rectified ? std::vector<double>{} : info.d;
  if (d.empty()) d.assign(5, 0.0);
  return fmt::format(
      "width: {:.0f}\nheight: {:.0f}\ndistortion_model: {}\nd: [{}]\n"
      "k: [{}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0]\n",
      width / bin_x, height / bin_y, model, fmt::join(d, ", "), fx / bin_x,
      binned(cx, info.roi_x, bin_x), fy / bin_y, binned(cy, info.roi_y, bin_y));
}

}  // namespace

std::optional<CameraModel> camera_of_bag(const bags::Source& source) {
  const bags::Contents& contents = bags::look_into(source.bag);
  const auto camera = bags::camera_of(contents, source.topic);
  if (!camera) return std::nullopt;
  return parse_camera(camera_text(camera->first, is_rectified(contents, source.topic)),
                      source.bag.string() + ":" + camera->topic);
}

CsvTable corners_of_bag(const bags::Source& source, const std::string& family) {
  const bags::DetectionSeries& series =
      bags::choose_detections(bags::look_into(source.bag), source.topic);
  CsvTable table;
  table.source = source.bag.string() + ":" + series.topic;
  table.header = {"t", "tag", "corner", "u", "v", "hamming", "margin"};
  std::set<std::string> others;
  for (std::size_t frame = 0; frame < series.frames.size(); ++frame) {
    for (const bags::TagDetection& tag : series.frames[frame].tags) {
      if (without_tag(tag.family) != without_tag(family)) {
        others.insert(tag.family);
        continue;
      }
      for (std::size_t corner = 0; corner < tag.corners.size(); ++corner) {
        // The detector counts from the edge of the first pixel.
        table.rows.push_back(
            {fmt::format("{}", series.times_s[frame]), fmt::format("{}", tag.id),
             fmt::format("{}", corner), fmt::format("{}", tag.corners[corner][0] - 0.5),
             fmt::format("{}", tag.corners[corner][1] - 0.5), fmt::format("{}", tag.hamming),
             fmt::format("{}", tag.decision_margin)});
        table.lines.push_back(frame + 1);
      }
    }
  }
  if (!table.rows.empty()) return table;
  throw bad_input(
      table.source,
      others.empty() ? std::string("no marker is seen")
                     : fmt::format("no marker of {}, only of {}", family, fmt::join(others, ", ")),
      others.empty() ? "check what the detector looks for" : "correct family in tags.yaml");
}

}  // namespace kinescope
