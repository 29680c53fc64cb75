// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/robot_difference.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include "calib/bundle/correction.h"
#include "calib/quality/robot_parameters.h"
#include "kinematics/core/error.h"
#include "kinematics/model/usual_unit.h"

namespace kinescope {
namespace {

std::vector<int> moving_joints(const KinematicTree& tree) {
  std::vector<int> out;
  for (std::size_t j = 0; j < tree.joints.size(); ++j)
    if (is_movable(tree.joints[j])) out.push_back(static_cast<int>(j));
  return out;
}

const Joint& joint_at(const KinematicTree& tree, int joint) {
  return tree.joints[static_cast<std::size_t>(joint)];
}

std::string types_in_words(const KinematicTree& tree) {
  std::string out;
  for (const int j : moving_joints(tree))
    out += joint_at(tree, j).type == JointType::kRevolute ? 'R' : 'P';
  return out;
}

// The joint before it that moves; -1: none.
int moving_parent(const KinematicTree& tree, int joint) {
  auto above = tree.parent_joint(joint_at(tree, joint).parent);
  while (above && tree.joints[above->index()].type == JointType::kFixed)
    above = tree.parent_joint(tree.joints[above->index()].parent);
  return above ? above->value : -1;
}

std::string name_or_base(const KinematicTree& tree, int joint) {
  return joint < 0 ? "the base" : joint_at(tree, joint).name;
}

// Of two joints that stand for one another.
void compare_place(const KinematicTree& first, const KinematicTree& other, int a,
                   const std::vector<int>& joint_of, std::vector<std::string>& differences) {
  const int b = joint_of[static_cast<std::size_t>(a)];
  const Joint& one = joint_at(first, a);
  const Joint& two = joint_at(other, b);
  if (one.type != two.type) {
    differences.push_back(fmt::format("{} is {} in one, {} in the other", one.name,
                                      to_string(one.type), to_string(two.type)));
  }
  const int parent = moving_parent(first, a);
  const int there = moving_parent(other, b);
  const int expected = parent < 0 ? -1 : joint_of[static_cast<std::size_t>(parent)];
  if (expected != there) {
    differences.push_back(fmt::format("{} is carried by {} in one, by {} in the other", one.name,
                                      name_or_base(first, parent), name_or_base(other, there)));
  }
}

// A change of gear is nearer to 1 than to what lies between two units of logs.
bool is_of_unit(JointType type, double ratio) {
  const double units = type == JointType::kRevolute ? kRadPerDegree : kMetrePerMillimetre;
  return 2.0 * std::abs(std::log(ratio)) > std::abs(std::log(units));
}

// How the two logs count the joint.
void compare_units(const Joint& one, const Joint& two, std::size_t at, RobotMatch& match) {
  if (one.type != two.type || one.scale == 0.0 || two.scale == 0.0) return;
  const auto here = usual_unit(one.type, std::abs(one.scale));
  const auto there = usual_unit(two.type, std::abs(two.scale));
  const double ratio = std::abs(one.scale / two.scale);
  if (here && there) {
    match.reading_ratio[at] = *here / *there;
  } else if (is_of_unit(one.type, ratio)) {
    match.reading_ratio[at] = ratio;
    match.own_unit[at] = true;
  }
}

// The channels that move it by design, beside its own, in the units of the first's log.
void compare_couplings(const KinematicTree& first, const KinematicTree& other, int a,
                       const RobotMatch& match, std::vector<std::string>& differences) {
  const Joint& one = joint_at(first, a);
  const Joint& two = joint_at(other, match.joint_of[static_cast<std::size_t>(a)]);
  const auto ratio_of = [&](const std::string& channel) {
    for (std::size_t j = 0; j < first.joints.size(); ++j) {
      const int there = match.joint_of[j];
      if (there >= 0 && joint_at(other, there).channel == channel) return match.reading_ratio[j];
    }
    return 1.0;
  };
  const auto shares = [&](const Joint& joint, bool of_other) {
    std::string out;
    for (const ChannelShare& share : joint.couplings) {
      const double unit = of_other ? ratio_of(share.channel) / ratio_of(joint.channel) : 1.0;
      out += fmt::format(" {:+.4g} {}", unit * share.ratio, share.channel);
    }
    return out.empty() ? std::string(" nothing") : out;
  };
  const std::string here = shares(one, false);
  const std::string there = shares(two, true);
  if (match.by_order ? one.couplings.size() == two.couplings.size() : here == there) return;
  differences.push_back(
      fmt::format("{} is coupled to{} in one, to{} in the other", one.name, here, there));
}

void compare_structure(const KinematicTree& first, const KinematicTree& other, RobotMatch& match) {
  match.reading_ratio.assign(first.joints.size(), 1.0);
  match.own_unit.assign(first.joints.size(), false);
  for (const int a : moving_joints(first)) {
    const auto at = static_cast<std::size_t>(a);
    if (match.joint_of[at] >= 0)
      compare_units(joint_at(first, a), joint_at(other, match.joint_of[at]), at, match);
  }
  std::set<int> found;
  for (const int a : moving_joints(first)) {
    const int b = match.joint_of[static_cast<std::size_t>(a)];
    if (b < 0) {
      match.differences.push_back(joint_at(first, a).name + " is not in the other");
      continue;
    }
    found.insert(b);
    compare_place(first, other, a, match.joint_of, match.differences);
    compare_couplings(first, other, a, match, match.differences);
  }
  for (const int b : moving_joints(other)) {
    if (!found.contains(b))
      match.differences.push_back(joint_at(other, b).name + " is not in the first");
  }
}

// The tree, and what effects stretch of the joints' values.
struct Model {
  KinematicTree tree;
  Eigen::VectorXd stretch;  // factor of every joint
};

bool is_encoder_scale(const Parameter& parameter, const Joint& joint) {
  return parameter.block == "effects" &&
         parameter.name == fmt::format("{} {}", joint.name, kScaleError);
}

Model model_of(const Calibration& run) {
  Model out{run.tree, Eigen::VectorXd::Ones(std::ssize(run.tree.joints))};
  for (const Parameter& parameter : run.parameters)
    for (std::size_t j = 0; j < run.tree.joints.size(); ++j)
      if (is_encoder_scale(parameter, run.tree.joints[j]))
        out.stretch[static_cast<Eigen::Index>(j)] += parameter.value;
  return out;
}

bool move_model(Model& model, const Calibration& run, const Parameter& parameter, double step) {
  for (std::size_t j = 0; j < model.tree.joints.size(); ++j) {
    if (!is_encoder_scale(parameter, model.tree.joints[j])) continue;
    model.stretch[static_cast<Eigen::Index>(j)] += step;
    return true;
  }
  return move_robot(model.tree, run, parameter, step);
}

// rad or m per unit of the first's log.
double scale_in_first(const Model& model, int joint, const RobotMatch& match) {
  const auto at = static_cast<std::size_t>(joint);
  const int own = match.joint_of[at];
  return joint_at(model.tree, own).scale * model.stretch[own] * match.reading_ratio[at];
}

// The axes in the order of the layout, at its readings; each points to where its channel grows.
std::vector<PlacedAxis> axes_at(const Model& model, const RobotLayout& layout,
                                const RobotMatch& match) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(std::ssize(model.tree.joints));
  std::vector<int> own;
  for (std::size_t k = 0; k < layout.joints.size(); ++k) {
    own.push_back(match.joint_of[static_cast<std::size_t>(layout.joints[k])]);
    values[own.back()] = scale_in_first(model, layout.joints[k], match) *
                         layout.readings[static_cast<Eigen::Index>(k)];
  }
  std::vector<JointId> joints;
  const std::vector<PlacedAxis> placed = placed_axes(model.tree, values, joints);
  std::vector<PlacedAxis> out;
  for (std::size_t k = 0; k < own.size(); ++k) {
    const auto at = std::ranges::find(joints, JointId{own[k]}) - joints.begin();
    out.push_back(placed[static_cast<std::size_t>(at)]);
    out.back().parent = layout.parents[k];
    if (joint_at(model.tree, own[k]).scale < 0.0) out.back().direction *= -1.0;
  }
  return out;
}

Eigen::VectorXd values_of(const Model& model, const RobotLayout& layout, const RobotMatch& match) {
  const Eigen::VectorXd of_axes = axis_values(layout.axes, axes_at(model, layout, match));
  Eigen::VectorXd out(std::ssize(layout.quantities));
  out.head(of_axes.size()) = of_axes;
  for (std::size_t k = 0; k < layout.joints.size(); ++k) {
    out[of_axes.size() + static_cast<Eigen::Index>(k)] =
        std::log(std::abs(scale_in_first(model, layout.joints[k], match)));
  }
  return out;
}

bool is_angle(const RobotQuantity& quantity) { return quantity.unit == "rad"; }

double difference_of(const RobotQuantity& quantity, double from, double to) {
  return is_angle(quantity) ? std::remainder(to - from, 2.0 * std::numbers::pi) : to - from;
}

// d number / d parameter: quantities x parameters.
Eigen::MatrixXd jacobian_of(const RobotLayout& layout, const Calibration& run,
                            const RobotMatch& match) {
  const Model model = model_of(run);
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Zero(std::ssize(layout.quantities), std::ssize(run.parameters));
  for (std::size_t p = 0; p < run.parameters.size(); ++p) {
    const double step = parameter_step(run.tree, run.parameters[p]);
    const auto moved = [&](double by) -> Eigen::VectorXd {
      Model other = model;
      if (!move_model(other, run, run.parameters[p], by)) return {};
      return values_of(other, layout, match);
    };
    const Eigen::VectorXd above = moved(step);
    if (above.size() == 0) continue;
    const Eigen::VectorXd below = moved(-step);
    for (Eigen::Index i = 0; i < out.rows(); ++i) {
      out(i, static_cast<Eigen::Index>(p)) =
          difference_of(layout.quantities[static_cast<std::size_t>(i)], below[i], above[i]) /
          (2.0 * step);
    }
  }
  return out;
}

std::string quantity_words(AxisQuantityKind kind, const Joint& axis, const Joint& next) {
  const bool turns = axis.type == JointType::kRevolute;
  switch (kind) {
    case AxisQuantityKind::kDistance:
      return fmt::format("distance {} - {}", axis.name, next.name);
    case AxisQuantityKind::kTwist:
      return fmt::format("twist {} - {}", axis.name, next.name);
    case AxisQuantityKind::kOffset:
      return fmt::format("{} {} (towards {})", turns ? "offset along" : "zero of", axis.name,
                         next.name);
    case AxisQuantityKind::kAngle:
      return fmt::format("{} {} (towards {})", turns ? "zero of" : "direction about", axis.name,
                         next.name);
    case AxisQuantityKind::kTilt:
      return fmt::format("tilt {} - {}", axis.name, next.name);
    case AxisQuantityKind::kTiltX:
      return fmt::format("tilt x {} - {}", axis.name, next.name);
    case AxisQuantityKind::kTiltY:
      return fmt::format("tilt y {} - {}", axis.name, next.name);
    case AxisQuantityKind::kPlaceX:
      return fmt::format("place x {} - {}", axis.name, next.name);
    case AxisQuantityKind::kPlaceY:
      return fmt::format("place y {} - {}", axis.name, next.name);
  }
  return {};
}

void name_quantities(const KinematicTree& first, RobotLayout& layout) {
  const auto joint = [&](int axis) -> const Joint& {
    return joint_at(first, layout.joints[static_cast<std::size_t>(axis)]);
  };
  for (const AxisQuantity& q : layout.axes.quantities) {
    layout.quantities.push_back({quantity_words(q.kind, joint(q.axis), joint(q.next)),
                                 is_length(q.kind) ? "m" : "rad", joint(q.axis).name});
  }
  for (const int j : layout.joints) {
    const std::string& name = joint_at(first, j).name;
    layout.quantities.push_back({"ratio of " + name, "", name});
  }
}

// In the middle of what the recordings have of a joint, so that a ratio that is off a little does
// not pass for a zero; 0 where none says.
double middle_reading(std::span<const Calibration> runs, std::span<const RobotMatch> matches,
                      int joint) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const auto at = static_cast<std::size_t>(joint);
    const int own = matches[r].joint_of[at];
    const JointLimits& range = runs[r].joints[static_cast<std::size_t>(own)].range;
    const double middle = 0.5 * (range.lower + range.upper) / joint_at(runs[r].tree, own).scale /
                          matches[r].reading_ratio[at];
    if (!std::isfinite(middle) || matches[r].own_unit[at]) continue;
    sum += middle;
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

double extent_of(const std::vector<PlacedAxis>& axes) {
  double out = 0.0;
  for (const PlacedAxis& a : axes)
    for (const PlacedAxis& b : axes) out = std::max(out, (a.point - b.point).norm());
  return out;
}

// A number of the robot as it bears on the height.
struct HeightVote {
  double difference = 0.0;
  double by_height = 0.0;
  double sigma = 0.0;

  [[nodiscard]] double square(double height_m) const {
    return std::pow((difference - by_height * height_m) / sigma, 2);
  }
};

// By how much higher the second's distances are meant, and how well that is known, m.
struct Height {
  double value = 0.0;
  double sigma = 0.0;
};

// Squares beyond three standard deviations count alike: what changed has no more to say.
constexpr double kChangedSquare = 9.0;

// Without the number that is to be judged by it: its own change must not hide in the height.
Height height_without(std::size_t left_out, const std::vector<HeightVote>& votes, double extent_m) {
  const auto sum_over = [&](auto term) {
    double sum = 0.0;
    for (std::size_t i = 0; i < votes.size(); ++i)
      if (i != left_out && votes[i].by_height != 0.0) sum += term(votes[i]);
    return sum;
  };
  // Nothing is known of it beforehand but the robot's size.
  const double prior = 1.0 / (extent_m * extent_m);
  const auto cost = [&](double height) {
    return prior * height * height + sum_over([&](const HeightVote& vote) {
             return std::min(kChangedSquare, vote.square(height));
           });
  };
  double best = 0.0;
  for (std::size_t i = 0; i < votes.size(); ++i) {
    if (i == left_out || votes[i].by_height == 0.0) continue;
    const double height = votes[i].difference / votes[i].by_height;
    if (cost(height) < cost(best)) best = height;
  }
  const auto over_agreeing = [&](auto term) {
    return sum_over([&](const HeightVote& vote) {
      return vote.square(best) < kChangedSquare ? term(vote) / (vote.sigma * vote.sigma) : 0.0;
    });
  };
  const double information =
      prior + over_agreeing([](const HeightVote& v) { return v.by_height * v.by_height; });
  const double pull = over_agreeing([](const HeightVote& v) { return v.by_height * v.difference; });
  return {pull / information, 1.0 / std::sqrt(information)};
}

void take_out_height(const Eigen::VectorXd& by_height, double extent_m,
                     std::vector<QuantityDifference>& differences) {
  if (by_height.isZero(0.0) || extent_m <= 0.0) return;
  std::vector<HeightVote> votes;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    const bool counts = differences[i].sigma && *differences[i].sigma > 0.0;
    votes.push_back({differences[i].difference,
                     counts ? by_height[static_cast<Eigen::Index>(i)] : 0.0,
                     counts ? *differences[i].sigma : 1.0});
  }
  for (std::size_t i = 0; i < differences.size(); ++i) {
    if (votes[i].by_height == 0.0) continue;
    const Height height = height_without(i, votes, extent_m);
    differences[i].difference -= votes[i].by_height * height.value;
    differences[i].sigma = std::hypot(votes[i].sigma, votes[i].by_height * height.sigma);
  }
}

// Those that change with the zeros of channels that count in a unit of their own, and their ratios.
void leave_out_own_units(const RobotLayout& layout, const Calibration& run, const RobotMatch& match,
                         std::vector<NumberState>& states) {
  const Model model = model_of(run);
  const std::size_t ratios = layout.quantities.size() - layout.joints.size();
  for (std::size_t k = 0; k < layout.joints.size(); ++k) {
    if (!match.own_unit[static_cast<std::size_t>(layout.joints[k])]) continue;
    const double step = parameter_step(run.tree, {});  // rad or m
    const auto turned = [&](double by) {
      RobotLayout there = layout;
      there.readings[static_cast<Eigen::Index>(k)] +=
          by / scale_in_first(model, layout.joints[k], match);
      return values_of(model, there, match);
    };
    const Eigen::VectorXd above = turned(step);
    const Eigen::VectorXd below = turned(-step);
    for (std::size_t i = 0; i < ratios; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      const double change = difference_of(layout.quantities[i], below[at], above[at]);
      if (has_influence(change / (2.0 * step))) states[i] = NumberState::kOwnUnit;
    }
    states[ratios + k] = NumberState::kOwnUnit;
  }
}

std::string why_not(NumberState state) {
  switch (state) {
    case NumberState::kEstimated:
      return {};
    case NumberState::kHeld:
      return "held as declared";
    case NumberState::kUndetermined:
      return "not determined by the recording";
    case NumberState::kNoChannel:
      return "no channel drives the joint";
    case NumberState::kOwnUnit:
      return "the logs count it in other units, from zeros of their own";
  }
  return {};
}

}  // namespace

RobotMatch match_robots(const KinematicTree& first, const KinematicTree& other) {
  RobotMatch out;
  std::map<std::string, int> by_channel;
  for (const int j : moving_joints(other))
    if (!joint_at(other, j).channel.empty()) by_channel[joint_at(other, j).channel] = j;
  std::vector<int> joint_of(first.joints.size(), -1);
  bool any = false;
  for (const int j : moving_joints(first)) {
    const auto found = by_channel.find(joint_at(first, j).channel);
    if (found == by_channel.end()) continue;
    joint_of[static_cast<std::size_t>(j)] = found->second;
    any = true;
  }
  if (!any) {
    if (types_in_words(first) != types_in_words(other)) return out;
    const std::vector<int> one = moving_joints(first), two = moving_joints(other);
    for (std::size_t k = 0; k < one.size(); ++k)
      joint_of[static_cast<std::size_t>(one[k])] = two[k];
    out.by_order = true;
  }
  out.joint_of = std::move(joint_of);
  compare_structure(first, other, out);
  return out;
}

RobotLayout robot_layout(std::span<const Calibration> runs, std::span<const RobotMatch> matches) {
  const KinematicTree& first = runs.front().tree;
  RobotLayout out;
  out.joints = moving_joints(first);
  out.readings.resize(std::ssize(out.joints));
  for (std::size_t k = 0; k < out.joints.size(); ++k) {
    out.readings[static_cast<Eigen::Index>(k)] = middle_reading(runs, matches, out.joints[k]);
    const auto at = std::ranges::find(out.joints, moving_parent(first, out.joints[k]));
    out.parents.push_back(at == out.joints.end() ? -1 : static_cast<int>(at - out.joints.begin()));
  }
  const std::vector<PlacedAxis> axes = axes_at(model_of(runs.front()), out, matches.front());
  out.axes = axis_layout(axes);
  out.extent_m = extent_of(axes);
  name_quantities(first, out);
  return out;
}

RobotNumbers robot_numbers(const RobotLayout& layout, const Calibration& run,
                           const RobotMatch& match) {
  const Model model = model_of(run);
  const Eigen::MatrixXd J = jacobian_of(layout, run, match);
  RobotNumbers out;
  out.values = values_of(model, layout, match);
  out.covariance = J * run.covariance * J.transpose();
  out.by_height = Eigen::VectorXd::Zero(out.values.size());
  const Eigen::VectorXd of_axes = axis_values_by_height(layout.axes, axes_at(model, layout, match));
  const Eigen::Index n = of_axes.size();
  out.by_height.head(n) = of_axes;
  const auto has_channel = [&](int axis) {
    const int first = layout.joints[static_cast<std::size_t>(axis)];
    return !joint_at(run.tree, match.joint_of[static_cast<std::size_t>(first)]).channel.empty();
  };
  for (Eigen::Index i = 0; i < out.values.size(); ++i) {
    NumberState state = number_state(J.row(i), run);
    const auto at = static_cast<std::size_t>(i);
    if (i < n && !(has_channel(layout.axes.quantities[at].axis) &&
                   has_channel(layout.axes.quantities[at].next)))
      state = NumberState::kNoChannel;
    out.states.push_back(state);
  }
  leave_out_own_units(layout, run, match, out.states);
  return out;
}

std::vector<QuantityDifference> robot_differences(const RobotLayout& layout,
                                                  const RobotNumbers& first,
                                                  const RobotNumbers& second) {
  std::vector<QuantityDifference> out;
  for (std::size_t i = 0; i < layout.quantities.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    QuantityDifference one;
    one.of = layout.quantities[i];
    one.first = first.values[at];
    one.second = second.values[at];
    one.difference = difference_of(one.of, one.first, one.second);
    const bool in_first =
        first.states[i] == NumberState::kEstimated || second.states[i] == NumberState::kOwnUnit;
    one.not_compared = why_not(in_first ? second.states[i] : first.states[i]);
    if (one.not_compared.empty())
      one.sigma = std::sqrt(first.covariance(at, at) + second.covariance(at, at));
    out.push_back(std::move(one));
  }
  take_out_height(0.5 * (first.by_height + second.by_height), layout.extent_m, out);
  fill_p_values(out);
  return out;
}

void fill_p_values(std::span<QuantityDifference> differences) {
  for (QuantityDifference& one : differences) {
    if (!one.sigma || *one.sigma <= 0.0) continue;
    one.p_value = std::erfc(std::abs(one.difference) / *one.sigma / std::numbers::sqrt2);
  }
}

void judge_together(std::span<QuantityDifference* const> differences, double level) {
  std::vector<QuantityDifference*> compared;
  for (QuantityDifference* one : differences)
    if (one->sigma) compared.push_back(one);
  std::ranges::stable_sort(compared, {}, &QuantityDifference::p_value);
  double last = 0.0;
  for (std::size_t k = 0; k < compared.size(); ++k) {
    QuantityDifference& one = *compared[k];
    last = std::max(last, std::min(1.0, one.p_value * static_cast<double>(compared.size() - k)));
    one.p_holm = last;
    one.changed = last < level;
  }
}

}  // namespace kinescope
