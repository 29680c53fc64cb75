// SPDX-License-Identifier: Apache-2.0
#include "calib/design/joint_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "kinematics/core/error.h"

namespace kinescope::design {
namespace {

// Of s(x) = 10 x^3 - 15 x^4 + 6 x^5 over 0..1 (Flash and Hogan 1985, eq. 3): highest first and
// second derivative.
constexpr double kPeakRate = 15.0 / 8.0;
const double kPeakAcceleration = 10.0 / std::numbers::sqrt3;
// Draws keep this share of a range's width from its ends, more than the digits of a table round.
constexpr double kInside = 1e-7;

double minimum_jerk(double x) { return x * x * x * (10.0 + x * (6.0 * x - 15.0)); }

std::size_t index_of(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
}

}  // namespace

JointSpace::JointSpace(KinematicTree tree, MotionLimits limits)
    : tree_(std::move(tree)), limits_(std::move(limits)) {
  for (std::size_t j = 0; j < tree_.joints.size(); ++j) {
    const Joint& joint = tree_.joints[j];
    if (!is_movable(joint)) continue;
    if (joint.channel.empty()) {
      throw bad_input(joint.name, "no channel drives it, and no motion of it can be planned",
                      "record a log that has its column");
    }
    const JointLimits& range = limits_.range[j];
    if (!(range.lower < range.upper)) {
      throw bad_input(joint.name, "its range is not known",
                      "give its limits in a URDF with --limits");
    }
    if (index_of(channels_, joint.channel) < channels_.size()) continue;
    channels_.push_back(joint.channel);
    leaders_.push_back(j);
  }
  const auto rows = static_cast<Eigen::Index>(tree_.joints.size());
  by_reading_ = Eigen::MatrixXd::Zero(rows, std::ssize(channels_));
  at_zero_ = Eigen::VectorXd::Zero(rows);
  for (std::size_t j = 0; j < tree_.joints.size(); ++j) {
    const Joint& joint = tree_.joints[j];
    if (!is_movable(joint)) continue;
    const auto row = static_cast<Eigen::Index>(j);
    at_zero_[row] = joint.offset;
    const auto add = [&](const std::string& channel, double ratio) {
      const std::size_t at = index_of(channels_, channel);
      if (at == channels_.size()) {
        throw bad_input(joint.name,
                        "the channel '" + channel + "' moves it and no joint of its own",
                        "plan for a robot whose channels drive one joint each");
      }
      by_reading_(row, static_cast<Eigen::Index>(at)) += joint.scale * ratio;
    };
    add(joint.channel, 1.0);
    for (const ChannelShare& share : joint.couplings) add(share.channel, share.ratio);
  }
  for (const bool coupled : {false, true})
    for (std::size_t c = 0; c < channels_.size(); ++c)
      if (tree_.joints[leaders_[c]].couplings.empty() != coupled) draw_order_.push_back(c);
}

Eigen::VectorXd JointSpace::values(const Eigen::VectorXd& readings) const {
  return at_zero_ + by_reading_ * readings;
}

double JointSpace::reading_for(std::size_t channel, double value,
                               const Eigen::VectorXd& readings) const {
  const auto row = static_cast<Eigen::Index>(leaders_[channel]);
  const auto column = static_cast<Eigen::Index>(channel);
  const double others =
      by_reading_.row(row).dot(readings) - by_reading_(row, column) * readings[column];
  return (value - at_zero_[row] - others) / by_reading_(row, column);
}

bool JointSpace::within(const Eigen::VectorXd& values) const {
  for (std::size_t j = 0; j < tree_.joints.size(); ++j) {
    if (!is_movable(tree_.joints[j])) continue;
    const double value = values[static_cast<Eigen::Index>(j)];
    if (value < limits_.range[j].lower || value > limits_.range[j].upper) return false;
  }
  return true;
}

// `share` of the range's width from its lower end, called for one channel after the other.
template <typename Share>
Eigen::VectorXd JointSpace::readings_at(Share share) const {
  Eigen::VectorXd readings = Eigen::VectorXd::Zero(std::ssize(channels_));
  for (const std::size_t c : draw_order_) {
    const JointLimits& range = limits_.range[leaders_[c]];
    const double inside = std::clamp(share(), kInside, 1.0 - kInside);
    readings[static_cast<Eigen::Index>(c)] =
        reading_for(c, range.lower + inside * (range.upper - range.lower), readings);
  }
  return readings;
}

std::optional<Eigen::VectorXd> JointSpace::draw(Rng& rng) const {
  Eigen::VectorXd readings =
      readings_at([&rng] { return 0.5 - 0.5 * std::cos(std::numbers::pi * rng.uniform()); });
  if (!within(values(readings))) return std::nullopt;
  return readings;
}

Eigen::VectorXd JointSpace::middle() const {
  return readings_at([] { return 0.5; });
}

double JointSpace::shortest_s(const Eigen::VectorXd& from, const Eigen::VectorXd& to) const {
  const Eigen::VectorXd way = (by_reading_ * (to - from)).cwiseAbs();
  double longest_s = 0.0;
  for (Eigen::Index j = 0; j < way.size(); ++j) {
    if (!is_movable(tree_.joints[static_cast<std::size_t>(j)])) continue;
    longest_s = std::max({longest_s, kPeakRate * way[j] / limits_.velocity[j],
                          std::sqrt(kPeakAcceleration * way[j] / limits_.acceleration[j])});
  }
  return longest_s;
}

RestToRestPath::RestToRestPath(const JointSpace& space, std::vector<Eigen::VectorXd> postures,
                               double duration_s)
    : postures_(std::move(postures)), ends_s_{0.0} {
  const double shortest = shortest_s(space, postures_);
  KINESCOPE_CHECK(duration_s >= shortest, "a motion no faster than the limits allow");
  const double slower = shortest > 0.0 ? duration_s / shortest : 1.0;
  for (std::size_t i = 1; i < postures_.size(); ++i)
    ends_s_.push_back(ends_s_.back() + slower * space.shortest_s(postures_[i - 1], postures_[i]));
}

double RestToRestPath::shortest_s(const JointSpace& space,
                                  const std::vector<Eigen::VectorXd>& postures) {
  double sum = 0.0;
  for (std::size_t i = 1; i < postures.size(); ++i)
    sum += space.shortest_s(postures[i - 1], postures[i]);
  return sum;
}

Eigen::VectorXd RestToRestPath::readings(double time_s) const {
  const auto next = std::ranges::upper_bound(ends_s_, time_s);
  if (next == ends_s_.begin()) return postures_.front();
  if (next == ends_s_.end()) return postures_.back();
  const auto i = static_cast<std::size_t>(next - ends_s_.begin());
  const double share = (time_s - ends_s_[i - 1]) / (ends_s_[i] - ends_s_[i - 1]);
  return postures_[i - 1] + minimum_jerk(share) * (postures_[i] - postures_[i - 1]);
}

std::vector<Eigen::VectorXd> in_short_order(const JointSpace& space,
                                            std::vector<Eigen::VectorXd> postures) {
  const std::size_t n = postures.size();
  for (std::size_t i = 1; i < n; ++i) {
    std::size_t nearest = i;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = i; k < n; ++k) {
      const double time = space.shortest_s(postures[i - 1], postures[k]);
      if (time < least) {
        least = time;
        nearest = k;
      }
    }
    std::swap(postures[i], postures[nearest]);
  }
  const auto time = [&](std::size_t a, std::size_t b) {
    return b < n ? space.shortest_s(postures[a], postures[b]) : 0.0;
  };
  constexpr double kShorter = 1e-9;  // s, more than rounding: rounds end
  for (bool shorter = true; shorter;) {
    shorter = false;
    for (std::size_t a = 0; a + 2 < n; ++a) {
      for (std::size_t b = a + 1; b + 1 < n; ++b) {
        // The way from a + 1 to b is gone through backwards.
        if (time(a, b) + time(a + 1, b + 1) + kShorter >= time(a, a + 1) + time(b, b + 1)) continue;
        std::reverse(postures.begin() + static_cast<std::ptrdiff_t>(a) + 1,
                     postures.begin() + static_cast<std::ptrdiff_t>(b) + 1);
        shorter = true;
      }
    }
  }
  return postures;
}

}  // namespace kinescope::design
