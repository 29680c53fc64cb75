// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/plot.h"
#include "app/report/prediction.h"
#include "app/report/sections.h"
#include "calib/camera/marker_set.h"

namespace kinescope::report {
namespace {

constexpr double kViewSize = 310.0;
constexpr double kViewMargin = 26.0;
constexpr double kLetter = 6.0;  ///< width of one, about
constexpr double kLetterHeight = 10.0;
constexpr double kAxisShare = 0.09;  ///< half length of a joint's axis, of the robot's extent
constexpr double kFrustumShare = 0.16;

/// One stroke or label of the drawing, in the frame of the views (x right, y up, z to the reader).
struct Stroke {
  std::vector<Eigen::Vector3d> points;
  std::string css_class;
  bool closed = false;
};
struct Label {
  Eigen::Vector3d at;
  std::string text;
  std::string css_class;
};
struct Drawing {
  std::vector<Stroke> strokes;
  std::vector<Label> labels;
};

/// The frame of the views from the base frame: the camera's for a video, the base's (z up) else.
Pose views_from_base(const Calibration& calibration) {
  Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
  if (calibration.kind == MeasurementKind::kCorners) {
    turn.diagonal() << 1.0, -1.0, -1.0, 1.0;  // camera: y down, z away
    return pose_from_matrix(turn) * calibration.T_camera_base;
  }
  turn.block<3, 3>(0, 0) << 1, 0, 0, 0, 0, 1, 0, -1, 0;  // z up, y away
  return pose_from_matrix(turn);
}

/// A frame in the middle of those whose posture is known.
int middle_frame(const Predictor& predictor, std::size_t frames) {
  std::vector<int> known;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    if (!predictor.links(static_cast<int>(frame)).empty()) known.push_back(static_cast<int>(frame));
  }
  return known.empty() ? -1 : known[known.size() / 2];
}

/// Bones from link to link and stems to the markers. A base that is the camera's frame is no part
/// of the robot.
void draw_links(const Calibration& calibration, const std::vector<Pose>& links, Drawing& drawing) {
  const bool no_base = base_is_camera(calibration);
  for (const Joint& joint : calibration.tree.joints) {
    if (no_base && joint.parent.value == 0) continue;
    drawing.strokes.push_back(
        {{links[joint.parent.index()].translation, links[joint.child.index()].translation},
         "bone"});
  }
  for (const Marker& marker : calibration.tree.markers) {
    if (no_base && marker.link.value == 0) continue;
    const Pose T = links[marker.link.index()] * marker.T_link_marker;
    drawing.strokes.push_back({{links[marker.link.index()].translation, T.translation}, "stem"});
  }
}

void draw_joints(const KinematicTree& tree, const std::vector<Pose>& links, double half,
                 Drawing& drawing) {
  for (const Joint& joint : tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    const Pose& T = links[joint.child.index()];
    const Eigen::Vector3d axis = T.rotation * joint.axis;
    const bool slides = joint.type == JointType::kPrismatic;
    drawing.strokes.push_back(
        {{T.translation - half * axis, T.translation + half * axis}, slides ? "slide" : "turn"});
    drawing.labels.push_back({T.translation + half * axis, joint.name, "joint-name"});
  }
}

void draw_markers(const KinematicTree& tree, const std::vector<Pose>& links, double smallest,
                  Drawing& drawing) {
  std::size_t series = 0;
  for (const Marker& marker : tree.markers) {
    const Pose T = links[marker.link.index()] * marker.T_link_marker;
    Stroke square{{}, "tag " + series_class(series++), true};
    for (const Eigen::Vector3d& corner : square_corners(std::max(marker.size_m, smallest))) {
      square.points.push_back(T * corner);
    }
    drawing.strokes.push_back(std::move(square));
    drawing.labels.push_back({T.translation, std::to_string(marker.id.value), "tag-name"});
  }
}

void draw_camera(const Calibration& calibration, std::size_t c, double depth, Drawing& drawing) {
  const CameraModel& camera = calibration.model_of_camera(c);
  if (!(camera.fx > 0.0) || camera.width <= 0) return;
  const Pose T = calibration.T_camera_base_of(c).inverse();
  std::vector<Eigen::Vector3d> corners;
  const std::array<std::array<double, 2>, 4> image = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  corners.reserve(image.size());
  for (const auto& [u, v] : image) {
    corners.push_back(T * Eigen::Vector3d(depth * (u * camera.width - camera.cx) / camera.fx,
                                          depth * (v * camera.height - camera.cy) / camera.fy,
                                          depth));
  }
  for (const Eigen::Vector3d& corner : corners) {
    drawing.strokes.push_back({{T.translation, corner}, "camera"});
  }
  drawing.strokes.push_back({corners, "camera", true});
  const std::string& name = calibration.name_of_camera(c);
  drawing.labels.push_back({T.translation, name.empty() ? "camera" : "camera " + name, "tick"});
}

/// Diagonal of what the robot itself spans.
double robot_extent(const Calibration& calibration, const std::vector<Pose>& links) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t k = base_is_camera(calibration) ? 1 : 0; k < links.size(); ++k) {
    points.push_back(links[k].translation);
  }
  for (const Marker& marker : calibration.tree.markers) {
    points.push_back(links[marker.link.index()] * marker.T_link_marker.translation);
  }
  if (points.empty()) return 1.0;
  Eigen::Vector3d low = points.front(), high = points.front();
  for (const Eigen::Vector3d& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  return std::max(1e-3, (high - low).norm());
}

/// One projection: which view axis goes right and which goes up.
struct View {
  std::string_view name;
  int right;
  double right_sign;
  int up;
  double up_sign;
};

Eigen::Vector2d flatten(const View& view, const Eigen::Vector3d& p) {
  return {view.right_sign * p(view.right), view.up_sign * p(view.up)};
}

std::string scale_bar(double pixels_per_m) {
  const std::vector<double> ticks = nice_ticks(0.0, 0.35 * kViewSize / pixels_per_m, 1);
  const double length = ticks.size() > 1 ? ticks[1] : 0.1;
  const double y = kViewSize - 8.0;
  return fmt::format(
      "<path class=\"scale\" d=\"M10 {}h{}\"/><text class=\"tick\" x=\"10\" y=\"{}\">{}</text>",
      drawn(y), drawn(length * pixels_per_m), drawn(y - 5.0),
      text_with_unit(length, Quantity::kLength));
}

/// A drawing fitted to the picture: the robot's own extent decides, the camera may lie outside.
class Sheet {
 public:
  Sheet(const View& view, const Pose& T_view_base, const Drawing& robot)
      : view_(view), T_view_base_(T_view_base) {
    Eigen::Vector2d low(1e300, 1e300), high(-1e300, -1e300);
    for (const Stroke& stroke : robot.strokes) {
      for (const Eigen::Vector3d& point : stroke.points) {
        low = low.cwiseMin(flatten(view, T_view_base * point));
        high = high.cwiseMax(flatten(view, T_view_base * point));
      }
    }
    scale_ = (kViewSize - 2.0 * kViewMargin) / std::max(1e-3, (high - low).maxCoeff());
    middle_ = 0.5 * (low + high);
  }

  [[nodiscard]] Eigen::Vector2d place(const Eigen::Vector3d& point) const {
    const Eigen::Vector2d p = scale_ * (flatten(view_, T_view_base_ * point) - middle_);
    return {0.5 * kViewSize + p.x(), 0.5 * kViewSize - p.y()};
  }
  [[nodiscard]] double scale() const { return scale_; }

  [[nodiscard]] std::string draw(const Drawing& drawing) const {
    std::string out;
    for (const Stroke& stroke : drawing.strokes) {
      std::string path;
      for (const Eigen::Vector3d& point : stroke.points) {
        const Eigen::Vector2d p = place(point);
        path += fmt::format("{}{} {}", path.empty() ? "M" : "L", drawn(p.x()), drawn(p.y()));
      }
      out += fmt::format("<path class=\"{}\" d=\"{}{}\"/>", stroke.css_class, path,
                         stroke.closed ? "Z" : "");
    }
    for (const Label& label : drawing.labels) {
      const Eigen::Vector2d p = place(label.at);
      // Left of its point where it would run over the edge.
      const bool left = p.x() + 4.0 + kLetter * static_cast<double>(label.text.size()) > kViewSize;
      out += fmt::format("<text class=\"{}\" x=\"{}\" y=\"{}\"{}>{}</text>", label.css_class,
                         drawn(p.x() + (left ? -4.0 : 4.0)),
                         drawn(std::max(p.y() - 3.0, kLetterHeight)),
                         left ? " text-anchor=\"end\"" : "", escaped(label.text));
    }
    return out;
  }

 private:
  const View& view_;
  const Pose& T_view_base_;
  double scale_ = 1.0;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
};

/// Where the camera lies when it is off the picture: an arrow at the edge.
std::string camera_arrow(const Sheet& sheet, const Eigen::Vector3d& camera) {
  const Eigen::Vector2d p = sheet.place(camera);
  const Eigen::Vector2d centre(0.5 * kViewSize, 0.5 * kViewSize);
  const Eigen::Vector2d run = p - centre;
  const double reach = run.cwiseAbs().maxCoeff();
  if (reach <= 0.5 * kViewSize - 8.0) return "";
  const Eigen::Vector2d tip = centre + run * ((0.5 * kViewSize - 5.0) / reach);
  const Eigen::Vector2d along = run.normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  const Eigen::Vector2d tail = tip - 24.0 * along;
  const Eigen::Vector2d left = tip - 7.0 * along + 4.0 * across;
  const Eigen::Vector2d right = tip - 7.0 * along - 4.0 * across;
  const bool at_right = tip.x() > 0.7 * kViewSize;
  return fmt::format(
      "<path class=\"camera\" d=\"M{} {}L{} {}M{} {}L{} {}L{} {}\"/><text class=\"tick\" x=\"{}\" "
      "y=\"{}\" text-anchor=\"{}\">to the camera</text>",
      drawn(tail.x()), drawn(tail.y()), drawn(tip.x()), drawn(tip.y()), drawn(left.x()),
      drawn(left.y()), drawn(tip.x()), drawn(tip.y()), drawn(right.x()), drawn(right.y()),
      drawn(tail.x() + (at_right ? -5.0 : 6.0)),
      drawn(std::clamp(tail.y(), 14.0, kViewSize - 26.0)), at_right ? "end" : "start");
}

std::string draw_view(const Drawing& robot, const Calibration& calibration, double depth,
                      const Pose& T_view_base, const View& view) {
  const Sheet sheet(view, T_view_base, robot);
  std::string out = sheet.draw(robot);
  if (calibration.kind == MeasurementKind::kCorners) {
    for (std::size_t c = 0; c < calibration.cameras(); ++c) {
      const Eigen::Vector3d centre = calibration.T_camera_base_of(c).inverse().translation;
      const std::string arrow = camera_arrow(sheet, centre);
      if (arrow.empty()) {
        Drawing camera;
        draw_camera(calibration, c, depth, camera);
        out += sheet.draw(camera);
      }
      out += arrow;
    }
  }
  return fmt::format(
      "<figure><svg class=\"view\" viewBox=\"0 0 {0} {0}\" role=\"img\" aria-label=\"Robot "
      "{1}\">{2}{3}"
      "</svg><figcaption>{1}</figcaption></figure>\n",
      drawn(kViewSize), view.name, out, scale_bar(sheet.scale()));
}

// In the frame of the views: x right, y up, z towards the reader.
std::array<View, 3> views_of(MeasurementKind kind) {
  const bool video = kind == MeasurementKind::kCorners;
  return {{
      {video ? "as the camera sees it (no perspective)" : "from the front (x right, z up)", 0, 1.0,
       1, 1.0},
      {video ? "from above, the camera below" : "from above (x right, y up)", 0, 1.0, 2, -1.0},
      {video ? "from the camera's right" : "from the right (y right, z up)", 2, -1.0, 1, 1.0},
  }};
}

/// The robot at one posture of the recording.
struct Posture {
  int frame = -1;  // -1: none is known
  double extent = 1.0;
  Drawing robot;
};

Posture drawn_posture(const Calibration& calibration) {
  const Predictor predictor(calibration);
  Posture out;
  out.frame = middle_frame(predictor, calibration.times_s.size());
  if (out.frame < 0) return out;
  const std::vector<Pose>& links = predictor.links(out.frame);
  out.extent = robot_extent(calibration, links);
  draw_links(calibration, links, out.robot);
  draw_joints(calibration.tree, links, kAxisShare * out.extent, out.robot);
  draw_markers(calibration.tree, links, 0.02 * out.extent, out.robot);
  return out;
}

std::string draw_view(const Posture& posture, const Calibration& calibration, const View& view) {
  return draw_view(posture.robot, calibration, kFrustumShare * posture.extent,
                   views_from_base(calibration), view);
}

}  // namespace

std::string robot_still(const Facts& facts) {
  const Calibration& calibration = facts.run.calibration;
  const Posture posture = drawn_posture(calibration);
  return posture.frame < 0 ? ""
                           : draw_view(posture, calibration, views_of(calibration.kind).front());
}

std::string robot_views(const Facts& facts) {
  const Calibration& calibration = facts.run.calibration;
  const Posture posture = drawn_posture(calibration);
  if (posture.frame < 0)
    return paragraph("No posture of the recording is known: the robot is not drawn.", "note");
  std::string out = "<div class=\"views\">\n";
  for (const View& view : views_of(calibration.kind)) out += draw_view(posture, calibration, view);
  out += "</div>\n";
  return out +
         paragraph(
             fmt::format(
                 "Posture at {}. Joint axes: red turns, blue slides; squares: markers with their "
                 "id; each view has its own scale.",
                 text_with_unit(calibration.times_s[static_cast<std::size_t>(posture.frame)],
                                Quantity::kTime)),
             "note");
}

}  // namespace kinescope::report
