// SPDX-License-Identifier: Apache-2.0
//
// Elements of an XML document, and numbers in their attributes with complaints that name file and
// line.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tinyxml2 {
class XMLElement;
}

namespace kinescope::urdf_document {

/// A new last child.
tinyxml2::XMLElement& add(tinyxml2::XMLElement& parent, const char* name);

/// Who is speaking, for complaints.
struct XmlOwner {
  std::string source;  ///< file name
  std::string owner;   ///< "link 'arm'"
};

/// "file:line" of the element.
[[nodiscard]] std::string xml_place(const tinyxml2::XMLElement& element, std::string_view source);

/// The attribute's numbers; nothing where it is absent. Throws bad_input unless it holds exactly
/// `count` finite numbers.
[[nodiscard]] std::vector<double> xml_numbers(const tinyxml2::XMLElement& element,
                                              const char* attribute, std::size_t count,
                                              const XmlOwner& owner);

}  // namespace kinescope::urdf_document
