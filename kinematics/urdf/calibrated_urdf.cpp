// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/calibrated_urdf.h"

#include <algorithm>

#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/error.h"
#include "kinematics/urdf/origin_text.h"
#include "kinematics/urdf/urdf.h"
#include "kinematics/urdf/urdf_inertia.h"
#include "kinematics/urdf/xml_tags.h"

namespace kinescope {
namespace {

using tinyxml2::XMLElement;
using urdf_document::TagSpan;
using urdf_document::TextChange;

// As exact as a file reads back (urdf.h); less is the same joint, whose digits stay as they are.
constexpr double kSame = 1e-12;

/// Exchanges the tags of one text.
class Exchange {
 public:
  Exchange(std::string_view text, const tinyxml2::XMLDocument& document)
      : text_(text), tags_(urdf_document::tags_of_elements(text, document)) {}

  /// The child of that name gets these attributes, and is made as the joint's first where there is
  /// none.
  void set(const XMLElement& joint, const char* child, const std::string& attributes) {
    const XMLElement* element = joint.FirstChildElement(child);
    if (element == nullptr) {
      const std::size_t behind = tags_.at(&joint).end;
      changes_.push_back({behind, behind, fmt::format("<{} {}/>", child, attributes)});
      return;
    }
    const TagSpan tag = tags_.at(element);
    const bool closed = text_.substr(tag.begin, tag.end - tag.begin).ends_with("/>");
    changes_.push_back(
        {tag.begin, tag.end, fmt::format("<{} {}{}>", child, attributes, closed ? "/" : "")});
  }

  [[nodiscard]] std::string text() && {
    return urdf_document::with_changes(text_, std::move(changes_));
  }

 private:
  std::string_view text_;
  std::map<const XMLElement*, TagSpan> tags_;
  std::vector<TextChange> changes_;
};

// By chords, which unlike arc cosines are exact near zero.
bool same_place(const Pose& a, const Pose& b) {
  return (a.translation - b.translation).norm() < kSame &&
         (a.matrix3() - b.matrix3()).norm() < kSame;
}

void set_origin(const XMLElement& joint, const Pose& origin, Exchange& exchange) {
  exchange.set(joint, "origin", urdf_document::origin_attributes(origin));
}

void set_joint(const XMLElement& element, const KinematicTree& drawn, const Joint& from,
               const KinematicTree& calibrated, const Joint& to, Exchange& exchange) {
  KINESCOPE_CHECK(from.type == to.type && drawn.links[from.parent.index()].name ==
                                              calibrated.links[to.parent.index()].name,
                  "a calibrated joint joins what the file says");
  if (!same_place(from.T_parent_joint, to.T_parent_joint))
    set_origin(element, to.T_parent_joint, exchange);
  if (is_movable(from) && (from.axis - to.axis).norm() > kSame)
    exchange.set(element, "axis", fmt::format("xyz=\"{}\"", urdf_document::number_text(to.axis)));
}

/// The marker that a link of the file is, by its name.
const Marker* marker_named(const KinematicTree& tree, const XMLElement& joint) {
  const XMLElement* child = joint.FirstChildElement("child");
  const std::string_view link = child == nullptr ? "" : child->Attribute("link");
  const auto found = std::ranges::find_if(tree.markers, [&](const Marker& marker) {
    return link == fmt::format("tag_{}", marker.id.value);
  });
  return found == tree.markers.end() ? nullptr : &*found;
}

void set_marker(const XMLElement& element, const KinematicTree& drawn,
                const KinematicTree& calibrated, Exchange& exchange) {
  const Marker* from = marker_named(drawn, element);
  const Marker* to = from == nullptr ? nullptr : calibrated.marker(from->id);
  if (to == nullptr ||
      drawn.links[from->link.index()].name != calibrated.links[to->link.index()].name)
    return;
  if (!same_place(from->T_link_marker, to->T_link_marker))
    set_origin(element, to->T_link_marker, exchange);
}

}  // namespace

std::string with_calibrated_joints(std::string_view text, const std::string& source,
                                   const KinematicTree& calibrated) {
  const KinematicTree drawn = parse_urdf(text, source);
  tinyxml2::XMLDocument document;
  KINESCOPE_CHECK(document.Parse(text.data(), text.size()) == tinyxml2::XML_SUCCESS,
                  "what was parsed can be parsed again");
  Exchange exchange(text, document);
  const XMLElement& robot = *document.FirstChildElement("robot");
  for (const XMLElement* element = robot.FirstChildElement("joint"); element != nullptr;
       element = element->NextSiblingElement("joint")) {
    const std::string_view name = element->Attribute("name");
    const auto from = drawn.joint(name);
    const auto to = calibrated.joint(name);
    if (from && to) {
      set_joint(*element, drawn, drawn.joints[from->index()], calibrated,
                calibrated.joints[to->index()], exchange);
    } else if (!from) {
      set_marker(*element, drawn, calibrated, exchange);
    }
  }
  return std::move(exchange).text();
}

}  // namespace kinescope
