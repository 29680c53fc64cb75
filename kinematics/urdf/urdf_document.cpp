// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/urdf_document.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/error.h"
#include "kinematics/core/text.h"
#include "kinematics/urdf/xml_numbers.h"

namespace kinescope::urdf_document {
namespace {

using tinyxml2::XMLDocument;
using tinyxml2::XMLElement;

/// One <joint> of the robot.
struct JointLine {
  std::string name;
  std::string parent;
  std::string child;
  int line = 0;
};

class Checker {
 public:
  explicit Checker(std::string source) : source_(std::move(source)) {}

  [[nodiscard]] std::string place(const XMLElement& element) const {
    return xml_place(element, source_);
  }

  [[nodiscard]] std::string name_of(const XMLElement& element) const {
    const char* name = element.Attribute("name");
    if (name == nullptr || *name == '\0') {
      throw bad_input(place(element), fmt::format("a <{}> has no name", element.Name()),
                      "give it a name attribute");
    }
    // Readers of XML disagree about what such bytes mean.
    if (clean_text(name) != name) {
      throw bad_input(
          place(element),
          fmt::format("the name of a <{}> holds bytes that are no text", element.Name()),
          "use letters, digits and _, and save the file as UTF-8");
    }
    return name;
  }

  [[nodiscard]] std::vector<double> numbers(const XMLElement& element, const char* attribute,
                                            std::size_t count, const std::string& owner) const {
    return xml_numbers(element, attribute, count, {.source = source_, .owner = owner});
  }

  void check_origin(const XMLElement& parent, const std::string& owner) const {
    const XMLElement* origin = parent.FirstChildElement("origin");
    if (origin == nullptr) return;
    static_cast<void>(numbers(*origin, "xyz", 3, owner));
    static_cast<void>(numbers(*origin, "rpy", 3, owner));
  }

  void check_type(const XMLElement& joint, const std::string& owner) const {
    const char* type = joint.Attribute("type");
    if (type == nullptr) {
      throw bad_input(place(joint), owner + " has no type",
                      "give it one of fixed, revolute, continuous, prismatic");
    }
    static const std::set<std::string> kKnown = {"fixed", "revolute", "continuous", "prismatic"};
    if (kKnown.contains(type)) return;
    throw bad_input(place(joint), fmt::format("{} has the type '{}'", owner, type),
                    "use fixed, revolute, continuous or prismatic");
  }

  void check_axis_and_limit(const XMLElement& joint, const std::string& owner) const {
    if (const XMLElement* axis = joint.FirstChildElement("axis")) {
      const std::vector<double> v = numbers(*axis, "xyz", 3, owner);
      const bool turns = std::string(joint.Attribute("type")) != "fixed";
      const double length = v.empty() ? 0.0 : std::hypot(v[0], v[1], v[2]);
      if (turns && length < 1e-6) {
        throw bad_input(place(*axis), owner + ": the axis has no length", "give it a direction");
      }
      if (turns && length > 1e6) {
        throw bad_input(place(*axis),
                        fmt::format("{}: the axis has a length of {:g}", owner, length),
                        "give it the length 1");
      }
    }
    const XMLElement* limit = joint.FirstChildElement("limit");
    if (limit == nullptr) return;
    double bounds[2] = {0.0, 0.0};
    for (const char* attribute : {"lower", "upper", "effort", "velocity"}) {
      const std::vector<double> v = numbers(*limit, attribute, 1, owner);
      if (v.empty()) continue;
      if (attribute == std::string("lower")) bounds[0] = v[0];
      if (attribute == std::string("upper")) bounds[1] = v[0];
    }
    if (bounds[0] > bounds[1]) {
      throw bad_input(place(*limit),
                      fmt::format("{}: the lower limit {} is above the upper limit {}", owner,
                                  bounds[0], bounds[1]),
                      "swap them");
    }
  }

  void check_mimic(const XMLElement& joint, const std::string& owner) const {
    const XMLElement* mimic = joint.FirstChildElement("mimic");
    if (mimic == nullptr) return;
    if (mimic->Attribute("joint") == nullptr) {
      throw bad_input(place(*mimic), owner + " mimics no joint", "add joint=\"..\"");
    }
    static_cast<void>(numbers(*mimic, "multiplier", 1, owner));
    static_cast<void>(numbers(*mimic, "offset", 1, owner));
  }

  [[nodiscard]] std::string end_of(const XMLElement& joint, const char* end,
                                   const std::map<std::string, int>& links,
                                   const std::string& owner) const {
    const XMLElement* element = joint.FirstChildElement(end);
    const char* link = element == nullptr ? nullptr : element->Attribute("link");
    if (link == nullptr) {
      throw bad_input(place(joint), fmt::format("{} names no {} link", owner, end),
                      fmt::format("add <{} link=\"..\"/>", end));
    }
    if (!links.contains(link)) {
      throw bad_input(place(*element),
                      fmt::format("{}: its {} link '{}' is not in the file", owner, end, link),
                      "add the link or correct the name");
    }
    return link;
  }

  [[nodiscard]] JointLine check_joint(const XMLElement& joint,
                                      const std::map<std::string, int>& links) const {
    JointLine out{.name = name_of(joint), .parent = {}, .child = {}, .line = joint.GetLineNum()};
    const std::string owner = fmt::format("joint '{}'", out.name);
    check_type(joint, owner);
    out.parent = end_of(joint, "parent", links, owner);
    out.child = end_of(joint, "child", links, owner);
    check_origin(joint, owner);
    check_axis_and_limit(joint, owner);
    check_mimic(joint, owner);
    return out;
  }

 private:
  std::string source_;
};

/// Names of the <link>s with their lines; no two alike.
std::map<std::string, int> collect_links(const XMLElement& robot, const Checker& check) {
  std::map<std::string, int> links;
  for (const auto* link = robot.FirstChildElement("link"); link != nullptr;
       link = link->NextSiblingElement("link")) {
    const std::string name = check.name_of(*link);
    const auto [other, fresh] = links.emplace(name, link->GetLineNum());
    if (!fresh) {
      throw bad_input(check.place(*link),
                      fmt::format("a link '{}' stands in line {} already", name, other->second),
                      "give every link its own name");
    }
  }
  if (links.empty()) throw bad_input(check.place(robot), "the robot has no link", "add its links");
  return links;
}

std::vector<JointLine> collect_joints(const XMLElement& robot,
                                      const std::map<std::string, int>& links,
                                      const Checker& check) {
  std::vector<JointLine> joints;
  for (const auto* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    JointLine line = check.check_joint(*joint, links);
    for (const JointLine& other : joints) {
      if (other.name == line.name) {
        throw bad_input(
            check.place(*joint),
            fmt::format("a joint '{}' stands in line {} already", line.name, other.line),
            "give every joint its own name");
      }
      if (other.child == line.child) {
        throw bad_input(check.place(*joint),
                        fmt::format("link '{}' has two parents, by the joints '{}' and '{}'",
                                    line.child, other.name, line.name),
                        "a URDF is a tree: cut one of them");
      }
    }
    joints.push_back(std::move(line));
  }
  return joints;
}

/// The one link without a parent.
std::string find_root(const std::map<std::string, int>& links, const std::vector<JointLine>& joints,
                      const std::string& source) {
  std::vector<std::pair<int, std::string>> roots;  // by line
  for (const auto& [name, line] : links) {
    if (std::ranges::find(joints, name, &JointLine::child) == joints.end()) {
      roots.emplace_back(line, name);
    }
  }
  std::ranges::sort(roots);
  if (roots.empty()) {
    throw bad_input(fmt::format("{}:{}", source, joints.front().line),
                    "the joints form a loop: every link has a parent",
                    "cut one joint so that one link is the root");
  }
  if (roots.size() > 1) {
    throw bad_input(
        fmt::format("{}:{}", source, roots[1].first),
        fmt::format("two links have no parent: '{}' and '{}'", roots[0].second, roots[1].second),
        "join them by a fixed joint");
  }
  return roots[0].second;
}

/// The joints in an order in which parents stand before children, otherwise that of the file.
std::vector<JointLine> sort_joints(std::vector<JointLine> joints, const std::string& root,
                                   const std::string& source) {
  std::vector<JointLine> sorted;
  std::set<std::string> known{root};
  while (!joints.empty()) {
    const auto next = std::ranges::find_if(
        joints, [&](const JointLine& joint) { return known.contains(joint.parent); });
    if (next == joints.end()) {
      throw bad_input(fmt::format("{}:{}", source, joints.front().line),
                      fmt::format("joint '{}' is part of a loop that does not reach the root '{}'",
                                  joints.front().name, root),
                      "a URDF is a tree: cut one joint of the loop");
    }
    known.insert(next->child);
    sorted.push_back(std::move(*next));
    joints.erase(next);
  }
  return sorted;
}

/// Deletes the children whose name is not in the list.
void keep_children(XMLElement& element, const std::set<std::string>& names) {
  for (tinyxml2::XMLNode* node = element.FirstChild(); node != nullptr;) {
    tinyxml2::XMLNode* next = node->NextSibling();
    const XMLElement* child = node->ToElement();
    if (child == nullptr || !names.contains(child->Name())) element.DeleteChild(node);
    node = next;
  }
}

/// urdfdom refuses a hinge or slide without limits; here they are optional. A range without width
/// is none.
void fill_in_limit(XMLElement& joint) {
  const std::string_view type = joint.Attribute("type");
  if (type != "revolute" && type != "prismatic") return;
  XMLElement* limit = joint.FirstChildElement("limit");
  if (limit == nullptr) limit = joint.InsertNewChildElement("limit");
  if (limit->Attribute("effort") == nullptr) limit->SetAttribute("effort", kAnyEffort);
  if (limit->Attribute("velocity") == nullptr) limit->SetAttribute("velocity", kAnyVelocity);
}

std::string cut_down(XMLDocument& document) {
  XMLElement& robot = *document.FirstChildElement("robot");
  keep_children(robot, {"link", "joint"});
  for (auto* link = robot.FirstChildElement("link"); link != nullptr;
       link = link->NextSiblingElement("link")) {
    const bool marker = std::string_view(link->Attribute("name")).starts_with("tag_");
    keep_children(*link, marker ? std::set<std::string>{"visual"} : std::set<std::string>{});
    for (auto* visual = link->FirstChildElement("visual"); visual != nullptr;
         visual = visual->NextSiblingElement("visual")) {
      keep_children(*visual, {"origin", "geometry"});
    }
  }
  for (auto* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    keep_children(*joint, {"parent", "child", "origin", "axis", "limit", "mimic"});
    fill_in_limit(*joint);
  }
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

/// Well-formed XML whose root is <robot>.
void parse_xml(XMLDocument& document, std::string_view text, const std::string& source) {
  if (text.find_first_not_of(" \t\r\n") == std::string_view::npos) {
    throw bad_input(source, "is empty", "name a URDF file");
  }
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    throw bad_input(fmt::format("{}:{}", source, std::max(1, document.ErrorLineNum())),
                    fmt::format("is not well-formed XML ({})", document.ErrorName()),
                    "is the file cut off, or no URDF at all?");
  }
  if (document.FirstChildElement("robot") == nullptr) {
    const XMLElement* root = document.RootElement();
    throw bad_input(source,
                    fmt::format("is no URDF: its root element is <{}>, not <robot>",
                                root == nullptr ? "nothing" : root->Name()),
                    "name a URDF file (convert SDF, MJCF or xacro first)");
  }
}

}  // namespace

KinematicPart kinematic_part(std::string_view text, const std::string& source) {
  XMLDocument document;
  parse_xml(document, text, source);
  const XMLElement& robot = *document.FirstChildElement("robot");
  const Checker check(source);
  static_cast<void>(check.name_of(robot));
  const std::map<std::string, int> links = collect_links(robot, check);
  std::vector<JointLine> joints = collect_joints(robot, links, check);
  const std::string root = find_root(links, joints, source);
  joints = sort_joints(std::move(joints), root, source);
  KinematicPart part{.text = cut_down(document), .root = root, .joint_order = {}};
  for (const JointLine& joint : joints) part.joint_order.push_back(joint.name);
  return part;
}

}  // namespace kinescope::urdf_document
