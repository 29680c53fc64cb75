// SPDX-License-Identifier: Apache-2.0
//
// Takes   a bag.
// Gives   what of it is a recording: joint states, cameras, images by their stamps, detections.
// Units   s after the bag's first message; values as published (rad, m, N m).
// Method  Messages carry two stamps: that of the header, by the clock of who measured, and that of
//         the recorder, when the message came. The first is used, moved to the recorder's clock
//         where the two are not the same (simulated time, a computer whose clock was never set), by
//         one number for all topics of that clock; where there is none, the second.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "kinematics/bags/bag.h"
#include "kinematics/bags/messages.h"

namespace kinescope::bags {

/// How the stamps of a topic were taken.
struct Stamps {
  bool of_header = false;  ///< false: those of the recorder
  double moved_s = 0.0;    ///< what was added to the headers' to be on the recorder's clock
  double delay_s = 0.0;    ///< median of recorder's minus header's, after that
  double jitter_s = 0.0;   ///< 5 to 95 % of the same
};

/// The messages of one topic that name the same joints, in the order of their stamps.
struct JointSeries {
  std::string topic;
  std::vector<std::string> names;
  std::vector<double> times_s;                 ///< increasing
  Eigen::MatrixXd position, velocity, effort;  ///< rows x names; no rows where never published
  Stamps stamps;
  std::size_t repeated = 0;  ///< messages with a stamp that another one has, left out
};

struct CameraSeries {
  std::string topic;
  CameraInfo first;
  bool changes = false;  ///< another one was published later
};

/// Images of one topic, without their pixels.
struct ImageSeries {
  std::string topic;
  std::string type;
  std::string encoding;                 ///< or format, of the first
  std::uint32_t width = 0, height = 0;  ///< of the first; 0 where it is packed
  std::vector<double> times_s;          ///< in the order of the messages
  Stamps stamps;
};

struct DetectionSeries {
  std::string topic;
  std::vector<double> times_s;
  std::vector<TagDetections> frames;
  Stamps stamps;
};

struct TopicCount {
  Topic topic;
  std::uint64_t messages = 0;
  double first_s = 0.0, last_s = 0.0;  ///< received
  std::uint64_t unreadable = 0;        ///< that are not what their type says
};

struct Contents {
  std::string source;
  std::int64_t start_ns = 0;                ///< the recorder's stamp of the first message
  std::vector<TopicCount> topics;           ///< by name
  std::vector<JointSeries> joints;          ///< by topic, those with most joints first
  std::vector<CameraSeries> cameras;        ///< by topic
  std::vector<ImageSeries> images;          ///< by topic
  std::vector<DetectionSeries> detections;  ///< by topic
  std::vector<std::string> warnings;
};

/// Reads the whole bag. Throws as open().
[[nodiscard]] Contents read_contents(const std::filesystem::path& bag);
/// The same, read once for all who ask.
[[nodiscard]] const Contents& look_into(const std::filesystem::path& bag);

/// True for a type of image that can be decoded.
[[nodiscard]] bool is_image_type(std::string_view type);

/// The stamp of an image's header, ns. Throws MessageFault.
[[nodiscard]] std::int64_t image_stamp_ns(const Topic& topic, std::string_view data);

// What a bag is asked for where no topic is named: the only one, or the one that is chosen by the
// rule that stands with each. All throw bad_input, naming the topics: none of that kind, a topic
// that is not there or of another kind, several among which the rule does not choose.

/// Joint states with positions: the series that gives a log its clock, beside which other joints
/// stand (bag_log.h). The one with the most joints; of several with as many one that is named
/// joint_states, then the one with the most messages. Commands are no measurement (is_commanded()).
/// Never refuses several.
[[nodiscard]] const JointSeries& choose_joints(const Contents& contents, const std::string& topic);
/// Images, not depths. Of one camera those that the others are made from (image_raw).
[[nodiscard]] const ImageSeries& choose_images(const Contents& contents, const std::string& topic);
[[nodiscard]] const DetectionSeries& choose_detections(const Contents& contents,
                                                       const std::string& topic);
/// The camera of the images (or of detections): the one in whose namespace they are, else the only
/// one of the bag. Nothing where none was published, or it was never calibrated (a focal length of
/// 0).
[[nodiscard]] std::optional<CameraSeries> camera_of(const Contents& contents,
                                                    const std::string& image_topic);

/// "/joint_states (sensor_msgs/JointState, 200 messages)", one line each, for messages and lists.
[[nodiscard]] std::vector<std::string> topic_lines(const Contents& contents);

}  // namespace kinescope::bags
