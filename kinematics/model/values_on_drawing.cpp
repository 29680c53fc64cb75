// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/values_on_drawing.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr std::size_t kMostOpen = 16;
// Arrangements whose misfits (rad, or of the robot's size) are nearer than this fit alike: drawings
// are wrong by degrees.
constexpr double kAlike = 0.05;

/// A quantity that the value of its axis' joint is added to.
bool is_zero(const AxisQuantity& quantity, std::span<const PlacedAxis> axes) {
  const bool turns = axes[static_cast<std::size_t>(quantity.axis)].type == JointType::kRevolute;
  return quantity.kind == (turns ? AxisQuantityKind::kAngle : AxisQuantityKind::kOffset);
}

std::vector<PlacedAxis> turned_round(std::span<const PlacedAxis> axes,
                                     const std::vector<std::size_t>& open, unsigned reversed) {
  std::vector<PlacedAxis> out(axes.begin(), axes.end());
  for (std::size_t k = 0; k < open.size(); ++k)
    if ((reversed >> k & 1U) != 0U) out[open[k]].direction *= -1.0;
  return out;
}

struct Drawing {
  std::span<const PlacedAxis> axes;
  AxisLayout layout;
  Eigen::VectorXd values;
  double size = 0.0;  // m, of its largest length
};

Drawing described(std::span<const PlacedAxis> axes) {
  Drawing out{axes, axis_layout(axes), {}, 0.0};
  out.values = axis_values(out.layout, axes);
  for (std::size_t i = 0; i < out.layout.quantities.size(); ++i) {
    if (is_length(out.layout.quantities[i].kind))
      out.size = std::max(out.size, std::abs(out.values[static_cast<Eigen::Index>(i)]));
  }
  return out;
}

Eigen::VectorXd differences(const Drawing& drawing, std::span<const PlacedAxis> found) {
  Eigen::VectorXd out = axis_values(drawing.layout, found) - drawing.values;
  for (std::size_t i = 0; i < drawing.layout.quantities.size(); ++i) {
    double& one = out[static_cast<Eigen::Index>(i)];
    if (!is_length(drawing.layout.quantities[i].kind))
      one = std::remainder(one, 2.0 * std::numbers::pi);
  }
  return out;
}

// From the axis before to this one, 0 to pi.
double angle_between(std::span<const PlacedAxis> axes, std::size_t axis) {
  const Eigen::Vector3d& before = axes[static_cast<std::size_t>(axes[axis].parent)].direction;
  const Eigen::Vector3d& own = axes[axis].direction;
  return std::atan2(before.cross(own).norm(), before.dot(own));
}

// Root of the sum of squares over what no joint's value changes.
double misfit(const Drawing& drawing, std::span<const PlacedAxis> found) {
  const Eigen::VectorXd all = differences(drawing, found);
  double sum = 0.0;
  // How nearly parallel axes lean says nothing of which way each of them points.
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (found[k].parent < 0) continue;
    const double one = angle_between(found, k) - angle_between(drawing.axes, k);
    sum += one * one;
  }
  for (std::size_t i = 0; i < drawing.layout.quantities.size(); ++i) {
    const AxisQuantity& quantity = drawing.layout.quantities[i];
    if (is_zero(quantity, drawing.axes)) continue;
    const double one = all[static_cast<Eigen::Index>(i)];
    const double scale = is_length(quantity.kind) ? drawing.size : 1.0;
    if (scale > 0.0) sum += one * one / (scale * scale);
  }
  return std::sqrt(sum);
}

}  // namespace

std::vector<ValueOnDrawing> values_on_drawing(std::span<const PlacedAxis> found,
                                              std::span<const PlacedAxis> drawn,
                                              const std::vector<bool>& is_open) {
  KINESCOPE_CHECK(found.size() == drawn.size() && found.size() == is_open.size(), "the same axes");
  std::vector<ValueOnDrawing> out(found.size());
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < is_open.size(); ++k)
    if (is_open[k]) open.push_back(k);
  if (open.size() > kMostOpen) return out;
  const Drawing drawing = described(drawn);
  std::vector<double> misfits;
  for (unsigned reversed = 0; reversed < 1U << open.size(); ++reversed)
    misfits.push_back(misfit(drawing, turned_round(found, open, reversed)));
  const double least = std::ranges::min(misfits);
  const auto fits = [&](unsigned reversed) { return misfits[reversed] <= least + kAlike; };
  // The plainest of those that fit: most of them as drawn.
  unsigned chosen = 0;
  int fewest = std::numeric_limits<int>::max();
  for (unsigned reversed = 0; reversed < misfits.size(); ++reversed) {
    if (!fits(reversed) || std::popcount(reversed) >= fewest) continue;
    fewest = std::popcount(reversed);
    chosen = reversed;
  }
  for (std::size_t k = 0; k < open.size(); ++k) {
    ValueOnDrawing& value = out[open[k]];
    value.direction = (chosen >> k & 1U) != 0U ? -1.0 : 1.0;
    value.direction_told = true;
    for (unsigned reversed = 0; reversed < misfits.size(); ++reversed) {
      const bool other = ((reversed ^ chosen) >> k & 1U) != 0U;
      if (other && fits(reversed)) value.direction_told = false;
    }
  }
  const Eigen::VectorXd all = differences(drawing, turned_round(found, open, chosen));
  for (std::size_t i = 0; i < drawing.layout.quantities.size(); ++i) {
    const AxisQuantity& quantity = drawing.layout.quantities[i];
    if (!is_zero(quantity, drawn)) continue;
    ValueOnDrawing& value = out[static_cast<std::size_t>(quantity.axis)];
    if (value.zero_told) continue;  // by the first of several axes behind it
    value.zero = all[static_cast<Eigen::Index>(i)];
    value.zero_told = true;
  }
  return out;
}

}  // namespace kinescope
