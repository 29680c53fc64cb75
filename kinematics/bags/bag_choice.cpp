// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <functional>
#include <set>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/bags/bag_contents.h"
#include "kinematics/core/error.h"
#include "kinematics/log/commanded.h"

namespace kinescope::bags {

namespace {

std::string list_of_topics(const Contents& contents) {
  constexpr std::size_t kMost = 12;
  std::vector<std::string> lines = topic_lines(contents);
  if (lines.empty()) return "it holds no topic";
  const std::size_t more = lines.size() > kMost ? lines.size() - kMost : 0;
  if (more > 0) lines.resize(kMost);
  return fmt::format("it holds {}{}", fmt::join(lines, ", "),
                     more > 0 ? fmt::format(" and {} more topics", more) : "");
}

[[noreturn]] void refuse_none(const Contents& contents, const std::string& topic,
                              const std::string& kind, const std::string& types) {
  const std::string place = topic.empty() ? contents.source : contents.source + ":" + topic;
  const std::string what = topic.empty() ? "" : " there";
  const auto slash = std::ranges::find_if(
      contents.topics, [&](const TopicCount& count) { return count.topic.name == "/" + topic; });
  const std::string left_out =
      contents.warnings.empty() ? "" : fmt::format("; {}", contents.warnings.front());
  throw bad_input(
      place, fmt::format("no {}{}: {}{}", kind, what, list_of_topics(contents), left_out),
      slash == contents.topics.end() ? fmt::format("record {}", types)
                                     : fmt::format("did you mean {}?", slash->topic.name));
}

[[noreturn]] void refuse_several(const Contents& contents, const std::string& kind,
                                 const std::vector<std::string>& topics) {
  throw bad_input(
      contents.source,
      fmt::format("holds {} of {} topics: {}", kind, topics.size(), fmt::join(topics, ", ")),
      fmt::format("name one: {0}:{1}, or fixed cameras that belong together: {0}:{1},{2}",
                  contents.source, topics[0], topics[1]));
}

/// The series of the topic, or all of them.
template <typename Series>
std::vector<const Series*> of_topic(const std::vector<Series>& all, const std::string& topic) {
  std::vector<const Series*> out;
  for (const Series& series : all)
    if (topic.empty() || series.topic == topic) out.push_back(&series);
  return out;
}

template <typename Series>
const Series& the_only_one(const Contents& contents, const std::vector<const Series*>& found,
                           const std::string& topic, const std::string& kind,
                           const std::string& types) {
  if (found.empty()) refuse_none(contents, topic, kind, types);
  if (found.size() == 1) return *found.front();
  std::vector<std::string> topics;
  for (const Series* series : found) topics.push_back(series->topic);
  refuse_several(contents, kind, topics);
}

bool shows_depth(const ImageSeries& series) {
  constexpr std::array kDepths = {"16UC1", "32FC1", "compressedDepth"};
  return std::ranges::any_of(
      kDepths, [&](const char* name) { return series.encoding.find(name) != std::string::npos; });
}

std::string camera_path(const std::string& topic) { return topic.substr(0, topic.rfind('/')); }

bool is_raw(const ImageSeries& series) { return series.topic.ends_with("image_raw"); }

/// Of one camera's topics the others are made from the raw images: packed, rectified, in grey.
bool is_made_from(const ImageSeries& series, const ImageSeries& raw) {
  if (&series == &raw || is_raw(series)) return false;
  const bool packed_of = series.topic.starts_with(raw.topic + "/");
  return packed_of || (is_raw(raw) && camera_path(series.topic) == camera_path(raw.topic));
}

}  // namespace

const JointSeries& choose_joints(const Contents& contents, const std::string& topic) {
  std::vector<const JointSeries*> found = of_topic(contents.joints, topic);
  std::erase_if(found, [](const JointSeries* series) { return series->position.size() == 0; });
  if (found.empty())
    refuse_none(contents, topic, "joint positions", "joint states (sensor_msgs/JointState)");
  // Best first: measured, with the most joints, by its usual name, with the most messages.
  const auto rank = [](const JointSeries* series) {
    return std::tuple(!is_commanded(series->topic), series->names.size(),
                      series->topic.ends_with("joint_states"), series->times_s.size());
  };
  std::ranges::stable_sort(found, std::greater{}, rank);
  return *found.front();
}

const ImageSeries& choose_images(const Contents& contents, const std::string& topic) {
  std::vector<const ImageSeries*> found = of_topic(contents.images, topic);
  if (topic.empty()) {
    std::erase_if(found, [](const ImageSeries* series) { return shows_depth(*series); });
    const std::vector<const ImageSeries*> all = found;
    std::erase_if(found, [&](const ImageSeries* series) {
      return std::ranges::any_of(
          all, [&](const ImageSeries* other) { return is_made_from(*series, *other); });
    });
  }
  return the_only_one(contents, found, topic, "images",
                      "images (sensor_msgs/Image or sensor_msgs/CompressedImage)");
}

const DetectionSeries& choose_detections(const Contents& contents, const std::string& topic) {
  return the_only_one(contents, of_topic(contents.detections, topic), topic,
                      "detections of markers", "detections (apriltag_msgs/AprilTagDetectionArray)");
}

std::optional<CameraSeries> camera_of(const Contents& contents, const std::string& image_topic) {
  const CameraSeries* own = nullptr;
  for (const CameraSeries& camera : contents.cameras) {
    const std::string path = camera_path(camera.topic);
    if (!image_topic.starts_with(path + "/")) continue;
    if (own == nullptr || path.size() > camera_path(own->topic).size()) own = &camera;
  }
  // Of a bag with one camera it is that one, whatever the topics are called.
  std::set<std::string> paths;
  for (const ImageSeries& series : contents.images) paths.insert(camera_path(series.topic));
  if (own == nullptr && contents.cameras.size() == 1 && paths.size() <= 1)
    own = &contents.cameras.front();
  if (own == nullptr || !(own->first.k[0] > 0.0)) return std::nullopt;
  return *own;
}

}  // namespace kinescope::bags
