// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/xml_numbers.h"

#include <cmath>

#include <fmt/format.h>
#include <tinyxml2.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope::urdf_document {

tinyxml2::XMLElement& add(tinyxml2::XMLElement& parent, const char* name) {
  return *parent.InsertNewChildElement(name);
}

std::string xml_place(const tinyxml2::XMLElement& element, std::string_view source) {
  return fmt::format("{}:{}", source, element.GetLineNum());
}

std::vector<double> xml_numbers(const tinyxml2::XMLElement& element, const char* attribute,
                                std::size_t count, const XmlOwner& owner) {
  const char* text = element.Attribute(attribute);
  if (text == nullptr) return {};
  std::vector<double> values;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t begin = rest.find_first_not_of(" \t\r\n");
    if (begin == std::string_view::npos) break;
    rest.remove_prefix(begin);
    const std::string_view word = rest.substr(0, rest.find_first_of(" \t\r\n"));
    rest.remove_prefix(word.size());
    const auto value = parse_number(word);
    if (!value || !std::isfinite(*value)) {
      throw bad_input(
          xml_place(element, owner.source),
          fmt::format("{}: <{} {}=\"{}\"> holds '{}', not a finite number", owner.owner,
                      element.Name(), attribute, text, word),
          word.find("${") == std::string_view::npos ? "correct it" : "run xacro on the file first");
    }
    values.push_back(*value);
  }
  if (values.size() != count) {
    throw bad_input(xml_place(element, owner.source),
                    fmt::format("{}: <{} {}=\"{}\"> has {} numbers, not {}", owner.owner,
                                element.Name(), attribute, text, values.size(), count),
                    "correct it");
  }
  return values;
}

}  // namespace kinescope::urdf_document
