// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/numbers.h"
#include "app/report/sections.h"
#include "kinematics/core/text.h"

namespace kinescope::report {
namespace {

constexpr double kLevel = 66.0;  ///< from a link to its child
constexpr double kBoxHeight = 34.0;
constexpr double kBoxWidth = 150.0;
constexpr double kColumn = 320.0;  ///< from a leaf to the next
constexpr double kTreeMargin = 10.0;
constexpr std::size_t kMostMarkers = 4;

/// Where each link stands: depth below the root, column of its leftmost leaf.
struct Layout {
  std::vector<int> depth;
  std::vector<int> column;
  int columns = 1;
  int depths = 1;
};

/// Columns are handed out leaf by leaf, first child below its parent.
int place_link(const KinematicTree& tree, LinkId link, int depth, int column, Layout& layout) {
  layout.depth[link.index()] = depth;
  layout.column[link.index()] = column;
  layout.depths = std::max(layout.depths, depth + 1);
  int next = column;
  bool first = true;
  for (const Joint& joint : tree.joints) {
    if (joint.parent != link) continue;
    if (!first) ++next;
    next = place_link(tree, joint.child, depth + 1, next, layout);
    first = false;
  }
  return next;
}

Layout lay_out(const KinematicTree& tree) {
  Layout layout;
  layout.depth.resize(tree.links.size(), 0);
  layout.column.resize(tree.links.size(), 0);
  if (!tree.links.empty()) layout.columns = place_link(tree, LinkId{0}, 0, 0, layout) + 1;
  return layout;
}

std::string markers_of(const KinematicTree& tree, std::size_t link) {
  std::string names;
  std::size_t count = 0;
  for (const Marker& marker : tree.markers) {
    if (marker.link.index() != link) continue;
    if (++count <= kMostMarkers) names += (names.empty() ? "" : ", ") + marker_name(marker.id);
  }
  if (count > kMostMarkers) names += fmt::format(" + {}", count - kMostMarkers);
  return names;
}

std::string shortened(const std::string& text, std::size_t most) {
  std::string clean = clean_text(text);
  if (clean.size() <= most) return clean;
  std::size_t end = most;
  while (end > 0 && (static_cast<unsigned char>(clean[end]) & 0xC0U) == 0x80U) --end;
  return clean.substr(0, end) + "…";
}

std::string link_box(const Facts& facts, std::size_t link, double x, double y) {
  const KinematicTree& tree = facts.run.calibration.tree;
  const std::string markers = markers_of(tree, link);
  std::string out =
      fmt::format("<rect class=\"box\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"5\"/>",
                  drawn(x), drawn(y), drawn(kBoxWidth), drawn(kBoxHeight));
  out += fmt::format("<text class=\"strong\" x=\"{}\" y=\"{}\">{}</text>", drawn(x + 8),
                     drawn(y + 14), escaped(shortened(tree.links[link].name, 22)));
  out += fmt::format("<text class=\"tick\" x=\"{}\" y=\"{}\">{}</text>", drawn(x + 8),
                     drawn(y + 28), escaped(markers.empty() ? "no marker" : markers));
  return out;
}

/// Two lines beside the edge: the joint, and the odds over its runner-up.
std::string joint_words(const Facts& facts, std::size_t index, double x, double y,
                        std::size_t letters) {
  const Joint& joint = facts.run.calibration.tree.joints[index];
  std::string first = fmt::format("{} · {}", joint.name, kinescope::to_string(joint.type));
  if (!joint.channel.empty()) first += " · channel " + joint.channel;
  std::string second;
  if (facts.run.structure &&
      facts.run.structure->joints.size() == facts.run.calibration.tree.joints.size()) {
    const StructureJoint& evidence = facts.run.structure->joints[index];
    second = "odds " + odds_text(evidence.log_odds);
    if (!evidence.runner_up.empty()) second += " over " + evidence.runner_up;
  }
  return fmt::format(
      "<text x=\"{0}\" y=\"{1}\">{2}</text><text class=\"tick\" x=\"{0}\" y=\"{3}\">{4}</text>",
      drawn(x), drawn(y), escaped(shortened(first, letters)), drawn(y + 13),
      escaped(shortened(second, letters)));
}

}  // namespace

std::string tree_drawing(const Facts& facts) {
  const KinematicTree& tree = facts.run.calibration.tree;
  const Layout layout = lay_out(tree);
  const double width = std::max(620.0, kColumn * layout.columns + kBoxWidth);
  const double height = 2 * kTreeMargin + kLevel * (layout.depths - 1) + kBoxHeight;
  const std::size_t letters = layout.columns == 1 ? 80 : 44;
  const auto x_of = [&](LinkId link) {
    return kTreeMargin + kColumn * layout.column[link.index()];
  };
  const auto y_of = [&](LinkId link) { return kTreeMargin + kLevel * layout.depth[link.index()]; };
  std::string edges, words, boxes;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const double from_x = x_of(joint.parent) + 20.0;
    const double from_y = y_of(joint.parent) + kBoxHeight;
    const double to_x = x_of(joint.child) + 20.0;
    const double to_y = y_of(joint.child);
    const std::string_view type = joint.type == JointType::kFixed       ? "fixed"
                                  : joint.type == JointType::kPrismatic ? "prismatic"
                                                                        : "revolute";
    edges += fmt::format("<path class=\"edge {}\" d=\"M{} {}V{}H{}V{}\"/>", type, drawn(from_x),
                         drawn(from_y), drawn(from_y + 5), drawn(to_x), drawn(to_y));
    words += joint_words(facts, j, to_x + 10.0, to_y - 18.0, letters);
  }
  for (std::size_t k = 0; k < tree.links.size(); ++k) {
    const LinkId link{static_cast<int>(k)};
    boxes += link_box(facts, k, x_of(link), y_of(link));
  }
  return fmt::format(
      "<svg class=\"tree\" viewBox=\"0 0 {} {}\" style=\"max-width:{}px;--w:{}px\" role=\"img\" "
      "aria-label=\"Tree of links and joints\">{}{}{}</svg>",
      drawn(width), drawn(height), drawn(width), drawn(width), edges, boxes, words);
}

}  // namespace kinescope::report
