// SPDX-License-Identifier: Apache-2.0
#include "kinematics/bags/bag_contents.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/core/memo.h"

namespace kinescope::bags {
namespace {

constexpr double kNanosecond = 1e-9;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// The two stamps of a message, ns.
struct StampPair {
  std::int64_t header = 0;
  std::int64_t received = 0;
};

/// Beyond all clocks, and so that differences of stamps fit.
constexpr std::int64_t kFarthestStamp = std::int64_t{1} << 61U;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * kNanosecond; }

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Clocks that are further apart than any message travels are two clocks.
constexpr double kOneClock = 5.0;  // s
/// Topics of one other clock are as far from the recorder's, but for what their messages travel and
/// how fast a simulation runs. Chosen, not measured.
constexpr double kSameOtherClock = 60.0;  // s

double lateness_s(const StampPair& pair) { return seconds(pair.received - pair.header); }

/// How late messages were recorded by their headers' stamps, which most of them must have, and not
/// all the same; else nothing.
std::optional<double> median_lateness_s(const std::vector<StampPair>& pairs) {
  std::vector<double> late;
  bool differ = pairs.size() == 1;
  for (const StampPair& pair : pairs) {
    if (pair.header != 0) late.push_back(lateness_s(pair));
    differ = differ || pair.header != pairs.front().header;
  }
  if (!differ || 2 * late.size() < pairs.size() || late.empty()) return std::nullopt;
  return median_of(std::move(late));
}

/// What brings headers' stamps to the recorder's clock: one number for all topics of another clock,
/// or images and joints would no longer fit together.
class Clocks {
 public:
  explicit Clocks(std::vector<double> lateness_s) {
    std::ranges::sort(lateness_s);
    for (const double late : lateness_s) {
      if (std::abs(late) <= kOneClock) continue;
      if (shifts_.empty() || late - shifts_.back() > kSameOtherClock) shifts_.push_back(late);
    }
  }
  [[nodiscard]] double shift_s(double lateness_s) const {
    if (std::abs(lateness_s) <= kOneClock) return 0.0;
    for (const double shift : shifts_)
      if (lateness_s >= shift && lateness_s - shift <= kSameOtherClock) return shift;
    return lateness_s;
  }

 private:
  std::vector<double> shifts_;  // increasing
};

Stamps how_stamped(const std::vector<StampPair>& pairs, const Clocks& clocks) {
  Stamps out;
  const std::optional<double> late_s = median_lateness_s(pairs);
  out.of_header = late_s.has_value();
  if (!late_s) return out;
  out.moved_s = clocks.shift_s(*late_s);
  out.delay_s = *late_s - out.moved_s;
  std::vector<double> late;
  for (const StampPair& pair : pairs)
    if (pair.header != 0) late.push_back(lateness_s(pair));
  constexpr double kTail = 0.05;
  out.jitter_s = quantile(late, 1.0 - kTail) - quantile(late, kTail);
  return out;
}

double time_of(const StampPair& pair, const Stamps& stamps, std::int64_t start_ns) {
  if (!stamps.of_header) return seconds(pair.received - start_ns);
  if (pair.header == 0) return seconds(pair.received - start_ns) - stamps.delay_s;
  return seconds(pair.header - start_ns) + stamps.moved_s;
}

constexpr std::size_t kQuantities = 3;

/// Messages of one topic with the same joints, as they come.
struct JointRows {
  std::vector<std::string> names;  // sorted
  std::vector<StampPair> stamps;
  // Position, velocity, effort: row by row in the order of `names`.
  std::array<std::vector<double>, kQuantities> values;
  std::array<bool, kQuantities> published{};
};

Eigen::MatrixXd matrix_of(const JointRows& group, const std::vector<std::size_t>& rows,
                          std::size_t quantity) {
  if (!group.published[quantity]) return {};
  const std::size_t columns = group.names.size();
  Eigen::MatrixXd out(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(columns));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      out(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) =
          group.values[quantity][rows[r] * columns + c];
    }
  }
  return out;
}

/// Rows in the order of time; of two with one stamp the first.
std::vector<std::size_t> in_order_of_time(const std::vector<double>& times_s) {
  std::vector<std::size_t> rows(times_s.size());
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  std::ranges::stable_sort(rows, {}, [&](std::size_t row) { return times_s[row]; });
  const auto same = std::ranges::unique(rows, {}, [&](std::size_t row) { return times_s[row]; });
  rows.erase(same.begin(), same.end());
  return rows;
}

JointSeries series_of(const std::string& topic, const JointRows& group, const Clocks& clocks,
                      std::int64_t start_ns) {
  JointSeries out;
  out.topic = topic;
  out.names = group.names;
  out.stamps = how_stamped(group.stamps, clocks);
  std::vector<double> times_s;
  times_s.reserve(group.stamps.size());
  for (const StampPair& pair : group.stamps) times_s.push_back(time_of(pair, out.stamps, start_ns));
  const std::vector<std::size_t> rows = in_order_of_time(times_s);
  for (const std::size_t row : rows) out.times_s.push_back(times_s[row]);
  out.repeated = times_s.size() - rows.size();
  out.position = matrix_of(group, rows, 0);
  out.velocity = matrix_of(group, rows, 1);
  out.effort = matrix_of(group, rows, 2);
  return out;
}

/// Everything of one topic while the bag is read.
struct TopicRecord {
  TopicCount count;
  std::vector<StampPair> stamps;  // of images and detections
  std::vector<JointRows> joints;
  std::vector<CameraInfo> cameras;  // the first, and the first that differs
  std::optional<ImageSeries> images;
  std::vector<TagDetections> detections;
};

void add_joints(TopicRecord& record, std::int64_t received_ns, std::string_view data) {
  const JointState state = read_joint_state(data, record.count.topic.encoding);
  std::vector<std::size_t> order(state.name.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) -> const std::string& { return state.name[i]; });
  std::vector<std::string> names;
  for (const std::size_t i : order) names.push_back(state.name[i]);
  if (names.empty() || std::ranges::adjacent_find(names) != names.end()) throw MessageFault{};
  auto group = std::ranges::find(record.joints, names, &JointRows::names);
  if (group == record.joints.end()) {
    constexpr std::size_t kMostSets = 64;  // of joints on one topic; chosen, not measured
    if (record.joints.size() == kMostSets) throw MessageFault{};
    record.joints.push_back({std::move(names), {}, {}, {}});
    group = std::prev(record.joints.end());
  }
  group->stamps.push_back({state.stamp_ns, received_ns});
  const std::array<const std::vector<double>*, kQuantities> said{&state.position, &state.velocity,
                                                                 &state.effort};
  for (std::size_t quantity = 0; quantity < kQuantities; ++quantity) {
    const std::vector<double>& values = *said[quantity];
    if (!values.empty()) group->published[quantity] = true;
    for (const std::size_t i : order)
      group->values[quantity].push_back(values.empty() ? kNone : values[i]);
  }
}

void add_camera(TopicRecord& record, std::string_view data) {
  CameraInfo camera = read_camera_info(data, record.count.topic.encoding);
  camera.stamp_ns = 0;
  constexpr std::size_t kFirstAndOther = 2;
  const bool known = !record.cameras.empty() && record.cameras.front() == camera;
  if (!known && record.cameras.size() < kFirstAndOther) record.cameras.push_back(std::move(camera));
}

void add_image(TopicRecord& record, std::int64_t received_ns, std::string_view data) {
  const Topic& topic = record.count.topic;
  ImageSeries first{topic.name, topic.type, {}, 0, 0, {}, {}};
  std::int64_t stamp_ns = 0;
  if (topic.type == kImageType) {
    const Image image = read_image(data, topic.encoding);
    stamp_ns = image.stamp_ns;
    first.encoding = image.encoding;
    first.width = image.width;
    first.height = image.height;
  } else {
    const PackedImage image = topic.type == kCompressedVideoType
                                  ? read_compressed_video(data, topic.encoding)
                                  : read_compressed_image(data, topic.encoding);
    stamp_ns = image.stamp_ns;
    first.encoding = image.format;
  }
  if (!record.images) record.images = std::move(first);
  record.stamps.push_back({stamp_ns, received_ns});
}

void add_detections(TopicRecord& record, std::int64_t received_ns, std::string_view data) {
  TagDetections found = read_tag_detections(data, record.count.topic.encoding);
  record.stamps.push_back({found.stamp_ns, received_ns});
  record.detections.push_back(std::move(found));
}

void add(TopicRecord& record, const Message& message, std::int64_t start_ns) {
  TopicCount& count = record.count;
  const double received_s = seconds(message.received_ns - start_ns);
  count.first_s = count.messages == 0 ? received_s : std::min(count.first_s, received_s);
  count.last_s = count.messages == 0 ? received_s : std::max(count.last_s, received_s);
  ++count.messages;
  if (count.topic.encoding == Encoding::kOther) return;
  try {
    if (count.topic.type == kJointStateType) {
      add_joints(record, message.received_ns, message.data);
    } else if (count.topic.type == kCameraInfoType) {
      add_camera(record, message.data);
    } else if (is_image_type(count.topic.type)) {
      add_image(record, message.received_ns, message.data);
    } else if (count.topic.type == kDetectionsType) {
      add_detections(record, message.received_ns, message.data);
    }
  } catch (const MessageFault&) {
    ++count.unreadable;
  }
}

std::vector<double> times_of(const std::vector<StampPair>& pairs, const Stamps& stamps,
                             std::int64_t start_ns) {
  std::vector<double> out;
  out.reserve(pairs.size());
  for (const StampPair& pair : pairs) out.push_back(time_of(pair, stamps, start_ns));
  return out;
}

void warn_of(const TopicRecord& record, Contents& out) {
  const TopicCount& count = record.count;
  if (count.unreadable > 0) {
    out.warnings.push_back(
        fmt::format("{}: {} of {} messages of {} are no valid {} and are left out{}", out.source,
                    count.unreadable, count.messages, count.topic.name, count.topic.type,
                    count.topic.type == kJointStateType
                        ? " (no names, a name twice, or lists of other lengths than the names)"
                        : ""));
  }
  const bool wanted = count.topic.type == kJointStateType || count.topic.type == kDetectionsType ||
                      count.topic.type == kCameraInfoType || is_image_type(count.topic.type);
  if (wanted && count.topic.encoding == Encoding::kOther) {
    out.warnings.push_back(
        fmt::format("{}: {} is encoded as '{}', which is not read (cdr and ros1 are)", out.source,
                    count.topic.name, count.topic.encoding_name));
  }
}

Clocks clocks_of(const std::vector<TopicRecord>& records) {
  std::vector<double> late_s;
  const auto add_series = [&](const std::vector<StampPair>& pairs) {
    if (const auto late = median_lateness_s(pairs)) late_s.push_back(*late);
  };
  for (const TopicRecord& record : records) {
    add_series(record.stamps);
    for (const JointRows& group : record.joints) add_series(group.stamps);
  }
  return Clocks(std::move(late_s));
}

void take(TopicRecord record, const Clocks& clocks, Contents& out) {
  warn_of(record, out);
  const std::string& topic = record.count.topic.name;
  for (const JointRows& group : record.joints)
    out.joints.push_back(series_of(topic, group, clocks, out.start_ns));
  if (!record.cameras.empty())
    out.cameras.push_back({topic, record.cameras.front(), record.cameras.size() > 1});
  if (!record.stamps.empty()) {
    const Stamps stamps = how_stamped(record.stamps, clocks);
    std::vector<double> times_s = times_of(record.stamps, stamps, out.start_ns);
    if (record.images) {
      record.images->times_s = std::move(times_s);
      record.images->stamps = stamps;
      out.images.push_back(std::move(*record.images));
    } else {
      out.detections.push_back({topic, std::move(times_s), std::move(record.detections), stamps});
    }
  }
  out.topics.push_back(std::move(record.count));
}

}  // namespace

bool is_image_type(std::string_view type) {
  return type == kImageType || type == kCompressedImageType || type == kCompressedVideoType;
}

std::int64_t image_stamp_ns(const Topic& topic, std::string_view data) {
  if (topic.type == kImageType) return read_image(data, topic.encoding).stamp_ns;
  if (topic.type == kCompressedVideoType)
    return read_compressed_video(data, topic.encoding).stamp_ns;
  return read_compressed_image(data, topic.encoding).stamp_ns;
}

Contents read_contents(const std::filesystem::path& bag) {
  const std::unique_ptr<Reader> reader = open(bag);
  Contents out;
  out.source = bag.string();
  std::vector<TopicRecord> records;
  bool first = true;
  while (auto message = reader->next()) {
    message->received_ns = std::clamp(message->received_ns, -kFarthestStamp, kFarthestStamp);
    if (std::exchange(first, false)) out.start_ns = message->received_ns;
    while (records.size() < reader->topics().size())
      records.push_back({{reader->topics()[records.size()]}, {}, {}, {}, {}, {}});
    add(records[message->topic], *message, out.start_ns);
  }
  while (records.size() < reader->topics().size())
    records.push_back({{reader->topics()[records.size()]}, {}, {}, {}, {}, {}});
  std::ranges::stable_sort(records, {},
                           [](const TopicRecord& record) { return record.count.topic.name; });
  out.warnings = reader->warnings();
  const Clocks clocks = clocks_of(records);
  for (TopicRecord& record : records) take(std::move(record), clocks, out);
  std::ranges::stable_sort(out.joints, std::greater{},
                           [](const JointSeries& series) { return series.names.size(); });
  return out;
}

namespace {

/// Changes with the files.
std::string key_of(const std::filesystem::path& bag) {
  std::string key = bag.string();
  for (const std::filesystem::path& file : files_of(bag)) {
    std::error_code error;
    const auto size = std::filesystem::file_size(file, error);
    const auto written = std::filesystem::last_write_time(file, error).time_since_epoch().count();
    key += fmt::format("|{} {}", size, written);
  }
  return key;
}

}  // namespace

const Contents& look_into(const std::filesystem::path& bag) {
  static const Memo<std::string, Contents> read;  // a bag is asked for joints, camera and images
  return read.get(key_of(bag), [&] { return read_contents(bag); });
}

std::vector<std::string> topic_lines(const Contents& contents) {
  std::vector<std::string> lines;
  for (const TopicCount& count : contents.topics) {
    lines.push_back(fmt::format("{} ({}, {} message{})", count.topic.name, count.topic.type,
                                count.messages, count.messages == 1 ? "" : "s"));
  }
  return lines;
}

}  // namespace kinescope::bags
