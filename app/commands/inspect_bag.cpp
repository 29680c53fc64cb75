// SPDX-License-Identifier: Apache-2.0
#include "app/commands/inspect_bag.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// What a topic holds, beyond its type, and how its stamps were taken.
struct TopicFacts {
  std::string words;
  std::optional<bags::Stamps> stamps;
};

template <typename Series>
const Series* series_of(const std::vector<Series>& all, const std::string& topic) {
  const auto found = std::ranges::find(all, topic, &Series::topic);
  return found == all.end() ? nullptr : &*found;
}

TopicFacts facts_of(const bags::Contents& contents, const std::string& topic) {
  if (const auto* joints = series_of(contents.joints, topic)) {
    std::vector<std::string> logged;
    if (joints->position.size() > 0) logged.emplace_back("positions");
    if (joints->velocity.size() > 0) logged.emplace_back("velocities");
    if (joints->effort.size() > 0) logged.emplace_back("efforts");
    return {fmt::format("{} of {}", fmt::join(logged, ", "), fmt::join(joints->names, ", ")),
            joints->stamps};
  }
  if (const auto* images = series_of(contents.images, topic)) {
    const std::string size =
        images->width > 0 ? fmt::format("{} x {}, ", images->width, images->height) : "";
    return {size + images->encoding, images->stamps};
  }
  if (const auto* camera = series_of(contents.cameras, topic)) {
    const std::string focal = camera->first.k[0] > 0.0
                                  ? fmt::format("focal length {:.1f} px", camera->first.k[0])
                                  : "not calibrated";
    return {focal + (camera->changes ? ", changes: the first is used" : ""), {}};
  }
  if (const auto* found = series_of(contents.detections, topic))
    return {"corners of markers", found->stamps};
  return {};
}

double rate_hz(const bags::TopicCount& count) {
  const double span_s = count.last_s - count.first_s;
  if (count.messages < 2 || !(span_s > 0.0)) return 0.0;
  return static_cast<double>(count.messages - 1) / span_s;
}

std::string stamp_words(const bags::Stamps& stamps) {
  if (!stamps.of_header) return "without stamps of its own";
  const std::string moved =
      stamps.moved_s == 0.0
          ? ""
          : fmt::format(", its clock {:.3f} s from the recorder's", -stamps.moved_s);
  return fmt::format("recorded {:.1f} ms after its stamp (scatter {:.1f} ms){}",
                     1e3 * stamps.delay_s, 1e3 * stamps.jitter_s, moved);
}

}  // namespace

bool shows_robot(const bags::Contents& contents) {
  if (!contents.images.empty() || !contents.detections.empty()) return true;
  if (!contents.joints.empty()) return false;
  throw bad_input(contents.source,
                  fmt::format("holds neither joint states nor images: {}",
                              contents.topics.empty()
                                  ? std::string("it is empty")
                                  : fmt::format("its topics are {}",
                                                fmt::join(bags::topic_lines(contents), ", "))),
                  "record sensor_msgs/JointState, and sensor_msgs/Image or CompressedImage");
}

void print_topics(const bags::Contents& contents) {
  for (const bags::TopicCount& count : contents.topics) {
    const TopicFacts facts = facts_of(contents, count.topic.name);
    std::string line =
        fmt::format("topic     {} ({}): {} message{}", count.topic.name, count.topic.type,
                    count.messages, count.messages == 1 ? "" : "s");
    if (const double rate = rate_hz(count); rate > 0.0) line += fmt::format(", {:.1f} Hz", rate);
    if (!facts.words.empty()) line += "; " + facts.words;
    if (facts.stamps && count.messages > 1) line += "; " + stamp_words(*facts.stamps);
    fmt::print("{}\n", line);
  }
}

nlohmann::json topics_json(const bags::Contents& contents) {
  nlohmann::json out = nlohmann::json::array();
  for (const bags::TopicCount& count : contents.topics) {
    nlohmann::json topic = {{"name", count.topic.name},   {"type", count.topic.type},
                            {"messages", count.messages}, {"unreadable", count.unreadable},
                            {"rate_hz", rate_hz(count)},  {"first_s", count.first_s},
                            {"last_s", count.last_s}};
    if (const auto stamps = facts_of(contents, count.topic.name).stamps) {
      topic["stamps"] = {{"of_header", stamps->of_header},
                         {"moved_s", stamps->moved_s},
                         {"delay_s", stamps->delay_s},
                         {"jitter_s", stamps->jitter_s}};
    }
    out.push_back(topic);
  }
  return out;
}

}  // namespace kinescope
