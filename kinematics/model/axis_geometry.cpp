// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/axis_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kinematics/core/error.h"
#include "kinematics/model/common_normal.h"

namespace kinescope {
namespace {

// Of the numbers that only say where the start was put: they follow it one to one.
constexpr double kFollowsStart = 0.5;
// Of central differences, rad and m: rounding and curvature both leave 1e-9.
constexpr double kStep = 1e-6;

// Of an axis, fixed to the link that carries it: z along it.
struct AxisFrame {
  Eigen::Vector3d origin, x, z;
};

Eigen::Vector3d across(const Eigen::Vector3d& v, const Eigen::Vector3d& direction) {
  return (v - direction * direction.dot(v)).normalized();
}

Eigen::Vector3d in_plane(const AxisFrame& frame, const PlacedAxis& axis) {
  return in_plane_across(frame.origin, frame.z, axis);
}

// Walks from axis to axis and gathers what lies between them.
class Walk {
 public:
  Walk(std::span<const PlacedAxis> axes, const std::vector<AxisStep>& steps)
      : axes_(axes), steps_(steps), frames_(axes.size()) {}

  void start(const AxisFrame& frame) {
    values.clear();
    quantities.clear();
    frames_.front() = frame;
    for (std::size_t k = 1; k < axes_.size(); ++k) step(k);
  }

  [[nodiscard]] const AxisFrame& before(std::size_t k) const {
    return frames_[static_cast<std::size_t>(std::max(0, axes_[k].parent))];
  }

  void step(std::size_t k) {
    const int from = std::max(0, axes_[k].parent);
    const auto add = [&](AxisQuantityKind kind, double value) {
      quantities.push_back({kind, from, static_cast<int>(k)});
      values.push_back(value);
    };
    switch (steps_[k]) {
      case AxisStep::kStart:
        break;
      case AxisStep::kNormal:
        return normal(k, add);
      case AxisStep::kParallel:
        return parallel(k, add);
      case AxisStep::kCoaxial:
        return coaxial(k, add);
    }
  }

  std::vector<AxisQuantity> quantities;
  std::vector<double> values;

 private:
  template <typename Add>
  void normal(std::size_t k, Add add) {
    const AxisFrame& frame = before(k);
    const PlacedAxis& axis = axes_[k];
    const Eigen::Vector3d across_both = frame.z.cross(axis.direction);
    const Eigen::Vector3d n = across_both.normalized();
    add(AxisQuantityKind::kAngle, angle_about(frame.z, frame.x, n));
    add(AxisQuantityKind::kTwist, std::atan2(across_both.norm(), frame.z.dot(axis.direction)));
    AxisFrame next{frame.origin, n, axis.direction};
    if (axis.type == JointType::kRevolute) {
      const NormalFeet at = normal_feet(frame.origin, frame.z, axis);
      add(AxisQuantityKind::kOffset, at.along_first);
      add(AxisQuantityKind::kDistance, n.dot(axis.point - frame.origin));
      next.origin = axis.point + at.along_second * axis.direction;
    }
    frames_[k] = next;
  }

  template <typename Add>
  void parallel(std::size_t k, Add add) {
    const AxisFrame& frame = before(k);
    const Eigen::Vector3d to = in_plane(frame, axes_[k]);
    const Eigen::Vector3d x = to.normalized();
    add(AxisQuantityKind::kAngle, angle_about(frame.z, frame.x, x));
    add(AxisQuantityKind::kDistance, to.norm());
    const auto [about_x, about_y] = tilts(frame.z, x, axes_[k].direction);
    add(AxisQuantityKind::kTwist, about_x);
    add(AxisQuantityKind::kTilt, about_y);
    frames_[k] = {frame.origin + to, across(x, axes_[k].direction), axes_[k].direction};
  }

  template <typename Add>
  void coaxial(std::size_t k, Add add) {
    const AxisFrame& frame = before(k);
    const PlacedAxis& axis = axes_[k];
    const auto [about_x, about_y] = tilts(frame.z, frame.x, axis.direction);
    add(AxisQuantityKind::kTiltX, about_x);
    add(AxisQuantityKind::kTiltY, about_y);
    AxisFrame next{frame.origin, across(frame.x, axis.direction), axis.direction};
    if (axis.type == JointType::kRevolute) {
      const Eigen::Vector3d to = in_plane(frame, axis);
      add(AxisQuantityKind::kPlaceX, to.dot(frame.x));
      add(AxisQuantityKind::kPlaceY, to.dot(frame.z.cross(frame.x)));
      next.origin = frame.origin + to;
    }
    frames_[k] = next;
  }

  // Of a nearly parallel direction, whichever way it points: about x, and about z cross x.
  static std::pair<double, double> tilts(const Eigen::Vector3d& z, const Eigen::Vector3d& x,
                                         const Eigen::Vector3d& direction) {
    const Eigen::Vector3d d = direction * (z.dot(direction) < 0.0 ? -1.0 : 1.0);
    return {std::atan2(-d.dot(z.cross(x)), d.dot(z)), std::atan2(d.dot(x), d.dot(z))};
  }

  std::span<const PlacedAxis> axes_;
  const std::vector<AxisStep>& steps_;
  std::vector<AxisFrame> frames_;
};

AxisFrame start_frame(const AxisLayout& layout, std::span<const PlacedAxis> axes) {
  AxisFrame out{Eigen::Vector3d::Zero(), axes.front().direction.unitOrthogonal(),
                axes.front().direction};
  if (layout.first_line >= 0) {
    const PlacedAxis& line = axes[static_cast<std::size_t>(layout.first_line)];
    out.origin = line.point;
    if (layout.foot_towards >= 0) {
      const NormalFeet at = normal_feet(line.point, line.direction,
                                        axes[static_cast<std::size_t>(layout.foot_towards)]);
      out.origin += at.along_first * line.direction;
    }
  }
  if (layout.turn_towards < 0) return out;
  const PlacedAxis& towards = axes[static_cast<std::size_t>(layout.turn_towards)];
  out.x = layout.turn_by_place ? in_plane(out, towards).normalized()
                               : out.z.cross(towards.direction).normalized();
  return out;
}

void choose_start(std::span<const PlacedAxis> axes, AxisLayout& layout) {
  const auto turns = [&](std::size_t k) { return axes[k].type == JointType::kRevolute; };
  for (std::size_t k = 0; k < axes.size(); ++k) {
    if (!turns(k)) continue;
    if (layout.first_line < 0) layout.first_line = static_cast<int>(k);
    const PlacedAxis& line = axes[static_cast<std::size_t>(layout.first_line)];
    if (layout.foot_towards < 0 && !is_nearly_parallel(line.direction, axes[k].direction))
      layout.foot_towards = static_cast<int>(k);
  }
  for (std::size_t k = 1; k < axes.size() && layout.turn_towards < 0; ++k) {
    if (!is_nearly_parallel(axes.front().direction, axes[k].direction))
      layout.turn_towards = static_cast<int>(k);
  }
  if (layout.turn_towards >= 0) return;
  const AxisFrame frame = start_frame(layout, axes);
  for (std::size_t k = 1; k < axes.size() && layout.turn_towards < 0; ++k) {
    if (!turns(k) || in_plane(frame, axes[k]).norm() < kOneLine_m) continue;
    layout.turn_towards = static_cast<int>(k);
    layout.turn_by_place = true;
  }
}

void choose_steps(std::span<const PlacedAxis> axes, AxisLayout& layout) {
  layout.steps.assign(axes.size(), AxisStep::kStart);
  for (std::size_t k = 1; k < axes.size(); ++k) {
    Walk walk(axes, layout.steps);
    walk.start(start_frame(layout, axes));
    const AxisFrame& frame = walk.before(k);
    const bool has_place = axes[k].type == JointType::kRevolute;
    layout.steps[k] = !is_nearly_parallel(frame.z, axes[k].direction) ? AxisStep::kNormal
                      : has_place && in_plane(frame, axes[k]).norm() >= kOneLine_m
                          ? AxisStep::kParallel
                          : AxisStep::kCoaxial;
  }
}

Eigen::VectorXd all_values(const AxisLayout& layout, std::span<const PlacedAxis> axes,
                           const AxisFrame& start) {
  Walk walk(axes, layout.steps);
  walk.start(start);
  return Eigen::Map<const Eigen::VectorXd>(walk.values.data(), std::ssize(walk.values));
}

// By a turn of the start about its axis and by a shift; angles here never jump.
Eigen::VectorXd by_start(const AxisLayout& layout, std::span<const PlacedAxis> axes, double turn,
                         const Eigen::Vector3d& shift) {
  const auto moved = [&](double step) {
    AxisFrame frame = start_frame(layout, axes);
    frame.x = Eigen::AngleAxisd(step * turn, frame.z) * frame.x;
    frame.origin += step * shift;
    return all_values(layout, axes, frame);
  };
  const Eigen::VectorXd difference = moved(kStep) - moved(-kStep);
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return difference.unaryExpr([](double d) { return std::remainder(d, kTurn); }) / (2.0 * kStep);
}

// Which numbers only say where the start was put: angles where it was turned to, lengths where it
// was shifted to (along an axis that turns, anywhere before one that slides).
std::vector<bool> only_of_start(const AxisLayout& layout, std::span<const PlacedAxis> axes,
                                const std::vector<AxisQuantity>& quantities) {
  const Eigen::VectorXd by_turn = by_start(layout, axes, 1.0, Eigen::Vector3d::Zero());
  Eigen::VectorXd by_shift = Eigen::VectorXd::Zero(by_turn.size());
  std::vector<Eigen::Vector3d> shifts{axes.front().direction};
  if (axes.front().type == JointType::kPrismatic)
    shifts = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()};
  for (const Eigen::Vector3d& shift : shifts)
    by_shift = by_shift.cwiseMax(by_start(layout, axes, 0.0, shift).cwiseAbs());
  std::vector<bool> out;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const auto& by = is_length(quantities[i].kind) ? by_shift : by_turn;
    out.push_back(std::abs(by[static_cast<Eigen::Index>(i)]) > kFollowsStart);
  }
  return out;
}

}  // namespace

bool is_length(AxisQuantityKind kind) {
  return kind == AxisQuantityKind::kDistance || kind == AxisQuantityKind::kOffset ||
         kind == AxisQuantityKind::kPlaceX || kind == AxisQuantityKind::kPlaceY;
}

std::vector<PlacedAxis> placed_axes(const KinematicTree& tree, const Eigen::VectorXd& values,
                                    std::vector<JointId>& joints) {
  const std::vector<Pose> T_base_link = forward_kinematics(tree, values);
  std::vector<int> axis_of(tree.joints.size(), -1);
  std::vector<PlacedAxis> out;
  joints.clear();
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const auto above = tree.parent_joint(joint.parent);
    const int parent = above ? axis_of[above->index()] : -1;
    axis_of[j] = parent;
    if (joint.type == JointType::kFixed) continue;
    const Pose T_base_joint = T_base_link[joint.parent.index()] * joint.T_parent_joint;
    axis_of[j] = static_cast<int>(out.size());
    out.push_back(
        {joint.type, T_base_joint.translation, T_base_joint.rotation * joint.axis, parent});
    joints.push_back(JointId{static_cast<int>(j)});
  }
  return out;
}

AxisLayout axis_layout(std::span<const PlacedAxis> axes) {
  AxisLayout layout;
  if (axes.empty()) return layout;
  choose_start(axes, layout);
  choose_steps(axes, layout);
  Walk walk(axes, layout.steps);
  walk.start(start_frame(layout, axes));
  const std::vector<bool> of_start = only_of_start(layout, axes, walk.quantities);
  for (std::size_t i = 0; i < walk.quantities.size(); ++i) {
    if (of_start[i]) continue;
    layout.quantities.push_back(walk.quantities[i]);
    layout.kept.push_back(static_cast<int>(i));
  }
  return layout;
}

Eigen::VectorXd axis_values(const AxisLayout& layout, std::span<const PlacedAxis> axes) {
  KINESCOPE_CHECK(axes.size() == layout.steps.size(), "axes of the robot that the layout is of");
  if (axes.empty()) return {};
  return all_values(layout, axes, start_frame(layout, axes))(layout.kept);
}

Eigen::VectorXd axis_values_by_height(const AxisLayout& layout, std::span<const PlacedAxis> axes) {
  KINESCOPE_CHECK(axes.size() == layout.steps.size(), "axes of the robot that the layout is of");
  if (axes.empty() || layout.first_line < 0 || layout.foot_towards >= 0)
    return Eigen::VectorXd::Zero(std::ssize(layout.kept));
  const Eigen::Vector3d& along = axes[static_cast<std::size_t>(layout.first_line)].direction;
  return by_start(layout, axes, 0.0, along)(layout.kept);
}

}  // namespace kinescope
