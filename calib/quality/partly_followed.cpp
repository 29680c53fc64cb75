// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/partly_followed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>

namespace kinescope {
namespace {

// Squared correlation of a joint's value with a reading that it follows: 0.999998 where it did, and
// 0.05 to 0.7 with another joint's (the halves of two recordings with exchanged or turned
// readings).
constexpr double kFollows = 0.999;
// Of the frames and of the joint's travel: less is what two motions may share by chance. Chosen.
constexpr double kLeastShare = 0.2;
// Frames whose reading is interpolated across the instant, both sides of it together.
constexpr Eigen::Index kAcross = 3;

struct FittedLine {
  double scale = 0.0;
  double offset = 0.0;
  double left = 0.0;         ///< sum of squares
  double correlation = 0.0;  ///< squared
};

// Running sums of a value against a reading.
class LineSums {
 public:
  LineSums(const Eigen::VectorXd& reading, const Eigen::VectorXd& value)
      : reading_mean_(reading.mean()), value_mean_(value.mean()), sums_(reading.size() + 1, 5) {
    sums_.row(0).setZero();
    for (Eigen::Index i = 0; i < reading.size(); ++i) {
      const double c = reading[i] - reading_mean_;
      const double q = value[i] - value_mean_;
      sums_.row(i + 1) = sums_.row(i);
      sums_.row(i + 1).array() += Eigen::Array<double, 1, 5>(c, q, c * c, c * q, q * q);
    }
  }

  /// Least squares over [first, end).
  [[nodiscard]] FittedLine line(Eigen::Index first, Eigen::Index end) const {
    const Eigen::Matrix<double, 1, 5> sum = sums_.row(end) - sums_.row(first);
    const auto n = static_cast<double>(end - first);
    const double cc = sum[2] - sum[0] * sum[0] / n;
    const double cq = sum[3] - sum[0] * sum[1] / n;
    const double qq = std::max(0.0, sum[4] - sum[1] * sum[1] / n);
    // What is left of a reading at rest is rounding.
    const bool rests = !(cc > kRounding * sums_(sums_.rows() - 1, 2));
    FittedLine out;
    out.scale = rests ? 0.0 : cq / cc;
    out.offset = sum[1] / n + value_mean_ - out.scale * (sum[0] / n + reading_mean_);
    out.left = std::max(0.0, qq - out.scale * cq);
    out.correlation = qq > 0.0 ? 1.0 - out.left / qq : 0.0;
    return out;
  }

 private:
  static constexpr double kRounding = 1e-9;
  double reading_mean_;
  double value_mean_;
  Eigen::Matrix<double, Eigen::Dynamic, 5> sums_;
};

// Frames in which both are known, in the order of time.
struct CommonFrames {
  std::vector<double> times_s;  ///< on the log's clock
  Eigen::MatrixXd readings;     ///< frames x channels
  Eigen::VectorXd value;        ///< frames; the joint's
};

CommonFrames common_frames(const Calibration& calibration, const JointLog& log,
                           const std::vector<int>& channels, std::size_t joint) {
  const Eigen::MatrixXd all = resample(log, calibration.times_s, calibration.time_offset_s);
  const Eigen::VectorXd value = calibration.corrected_values.col(static_cast<Eigen::Index>(joint));
  std::vector<Eigen::Index> frames;
  for (Eigen::Index f = 0; f < all.rows(); ++f) {
    bool known = std::isfinite(value[f]);
    for (const int c : channels) known = known && std::isfinite(all(f, c));
    if (known) frames.push_back(f);
  }
  const auto time = [&](Eigen::Index f) {
    return calibration.times_s[static_cast<std::size_t>(f)];
  };
  std::ranges::sort(frames, {}, time);
  CommonFrames out{{}, all(frames, channels), value(frames)};
  for (const Eigen::Index f : frames) out.times_s.push_back(time(f) + calibration.time_offset_s);
  return out;
}

// The joint over a part of the frames: as a line over one of the channels, or as itself.
struct BestLine {
  int channel = -1;  ///< index into the channels looked among; -1: none
  FittedLine line;
  double cost = std::numeric_limits<double>::infinity();
};

class JointOverChannels {
 public:
  explicit JointOverChannels(const CommonFrames& common) : value_(common.value) {
    for (Eigen::Index c = 0; c < common.readings.cols(); ++c)
      sums_.emplace_back(common.readings.col(c), value_);
    travel_ = value_.maxCoeff() - value_.minCoeff();
  }

  [[nodiscard]] BestLine best(Eigen::Index first, Eigen::Index end) const {
    // No fit is closer than rounding.
    const double least = 1e-12 * travel_ * travel_;
    const auto n = static_cast<double>(end - first);
    const double of_number = 0.5 * std::log(static_cast<double>(value_.size()));
    const auto cost = [&](double left, int numbers) {
      return 0.5 * n * std::log(left / n + least) + numbers * of_number;
    };
    BestLine out;
    for (std::size_t c = 0; c < sums_.size(); ++c) {
      const FittedLine line = sums_[c].line(first, end);
      if (c == 0) out.cost = cost(line.left / std::max(1e-300, 1.0 - line.correlation), 1);
      if (const double with = cost(line.left, 2); with < out.cost)
        out = {static_cast<int>(c), line, with};
    }
    if (out.channel >= 0 && !is_followed(out.line, first, end)) out.channel = -1;
    return out;
  }

 private:
  [[nodiscard]] bool is_followed(const FittedLine& line, Eigen::Index first,
                                 Eigen::Index end) const {
    const auto part = value_.segment(first, end - first);
    return line.correlation > kFollows &&
           static_cast<double>(part.size()) > kLeastShare * static_cast<double>(value_.size()) &&
           part.maxCoeff() - part.minCoeff() > kLeastShare * travel_;
  }

  Eigen::VectorXd value_;
  std::vector<LineSums> sums_;
  double travel_ = 0.0;
};

struct TwoParts {
  std::array<BestLine, 2> parts;
  Eigen::Index end = 0;    ///< of the first
  Eigen::Index begin = 0;  ///< of the second
  [[nodiscard]] double cost() const { return parts[0].cost + parts[1].cost; }
};

std::optional<TwoParts> best_split(const JointOverChannels& joint, Eigen::Index frames) {
  constexpr Eigen::Index kFewest = 4;  // a line and something left beside it
  std::optional<TwoParts> best;
  for (Eigen::Index end = kFewest; end + kAcross + kFewest <= frames; ++end) {
    TwoParts split{{joint.best(0, end), joint.best(end + kAcross, frames)}, end, end + kAcross};
    if (!best || split.cost() < best->cost()) best = split;
  }
  return best;
}

std::vector<std::size_t> undriven_joints(const Calibration& calibration) {
  std::vector<std::size_t> out;
  for (std::size_t j = 0; j < calibration.tree.joints.size(); ++j) {
    const Joint& joint = calibration.tree.joints[j];
    if (is_movable(joint) && joint.channel.empty()) out.push_back(j);
  }
  return out;
}

std::vector<FollowedPart> part_of(const BestLine& part, const std::vector<int>& channels,
                                  double from_s, double to_s) {
  if (part.channel < 0) return {};
  return {{channels[static_cast<std::size_t>(part.channel)], part.line.scale, part.line.offset,
           from_s, to_s}};
}

// What `part` reads, as the channel of `main` would.
FollowedPart as_reading_of(const FollowedPart& part, const FollowedPart& main) {
  // A sign or an exchange, and no other unit, where it is that to as much as a fit tells. Chosen;
  // ratios were within 0.7 %.
  constexpr double kSame = 0.01;
  FollowedPart out = part;
  out.scale = part.scale / main.scale;
  out.offset = (part.offset - main.offset) / main.scale;
  if (std::abs(std::abs(out.scale) - 1.0) < kSame) out.scale = std::copysign(1.0, out.scale);
  return out;
}

}  // namespace

std::vector<PartlyFollowed> partly_followed(const Calibration& calibration, const JointLog& log,
                                            const std::vector<int>& idle) {
  std::vector<PartlyFollowed> out;
  if (idle.empty() || calibration.corrected_values.size() == 0) return out;
  for (const std::size_t joint : undriven_joints(calibration)) {
    const CommonFrames common = common_frames(calibration, log, idle, joint);
    const auto frames = static_cast<Eigen::Index>(common.times_s.size());
    if (frames == 0) continue;
    const auto split = best_split(JointOverChannels(common), frames);
    if (!split) continue;
    const auto time = [&](Eigen::Index f) { return common.times_s[static_cast<std::size_t>(f)]; };
    PartlyFollowed followed{joint, part_of(split->parts[0], idle, time(0), time(split->end - 1)),
                            part_of(split->parts[1], idle, time(split->begin), time(frames - 1))};
    if (!followed.before.empty() || !followed.after.empty()) out.push_back(std::move(followed));
  }
  return out;
}

std::optional<JointLog> with_readings_mended(const JointLog& log,
                                             const std::vector<PartlyFollowed>& joints) {
  JointLog out = log;
  std::set<int> used;
  for (const PartlyFollowed& joint : joints) {
    if (joint.before.empty() || joint.after.empty()) return std::nullopt;
    const FollowedPart& main = joint.before.front();
    if (!used.insert(main.channel).second) return std::nullopt;
    const FollowedPart part = as_reading_of(joint.after.front(), main);
    const double between_s = 0.5 * (main.to_s + part.from_s);
    for (std::size_t row = 0; row < log.size(); ++row) {
      if (log.times_s[row] < between_s) continue;
      const auto r = static_cast<Eigen::Index>(row);
      out.values(r, main.channel) = part.scale * log.values(r, part.channel) + part.offset;
    }
  }
  return joints.empty() ? std::nullopt : std::optional(std::move(out));
}

std::string words_of(const PartlyFollowed& followed, const Calibration& calibration,
                     const JointLog& log) {
  const std::string& name = calibration.tree.joints[followed.joint].name;
  const auto channel = [&](const FollowedPart& part) {
    return fmt::format("'{}'", log.channels[static_cast<std::size_t>(part.channel)]);
  };
  if (followed.after.empty()) {
    const FollowedPart& part = followed.before.front();
    return fmt::format(
        "{}: {} follows {} up to {} = {:.6g} and no longer: a reading that froze or "
        "lost its joint; a log that ends there has a channel for the joint",
        log.source, name, channel(part), log.time_column, part.to_s);
  }
  const FollowedPart& after = followed.after.front();
  if (followed.before.empty())
    return fmt::format(
        "{}: {} follows {} from {} = {:.6g} on and not before; a log that begins "
        "there has a channel for the joint",
        log.source, name, channel(after), log.time_column, after.from_s);
  const FollowedPart& before = followed.before.front();
  std::string behind = channel(after);
  if (before.channel == after.channel)
    behind = before.scale * after.scale < 0.0 ? "-" + behind : behind + " from another zero";
  return fmt::format("{}: {} follows {} up to {} = {:.6g}, and {} from there on", log.source, name,
                     channel(before), log.time_column, before.to_s, behind);
}

}  // namespace kinescope
