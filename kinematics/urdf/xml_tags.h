// SPDX-License-Identifier: Apache-2.0
//
// Where the elements of an XML text begin, to exchange single tags and leave all else as it is.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tinyxml2 {
class XMLDocument;
class XMLElement;
}  // namespace tinyxml2

namespace kinescope::urdf_document {

/// A start tag, from its '<' to behind its '>'.
struct TagSpan {
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// All start tags of a well-formed text in its order; comments, CDATA, declarations are passed
/// over.
[[nodiscard]] std::vector<TagSpan> start_tags(std::string_view text);

/// The tag of every element of the document that was parsed from this text.
[[nodiscard]] std::map<const tinyxml2::XMLElement*, TagSpan> tags_of_elements(
    std::string_view text, const tinyxml2::XMLDocument& document);

/// What takes the place of [begin, end) of a text.
struct TextChange {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::string text;
};

/// Changes do not overlap; those at one place stand in the order given.
[[nodiscard]] std::string with_changes(std::string_view text, std::vector<TextChange> changes);

}  // namespace kinescope::urdf_document
