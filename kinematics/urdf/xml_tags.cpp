// SPDX-License-Identifier: Apache-2.0
#include "kinematics/urdf/xml_tags.h"

#include <algorithm>

#include <tinyxml2.h>

#include "kinematics/core/error.h"

namespace kinescope::urdf_document {
namespace {

/// Behind `closing`, which a well-formed text has.
std::size_t behind(std::string_view text, std::string_view closing, std::size_t from) {
  const std::size_t found = text.find(closing, from);
  return found == std::string_view::npos ? text.size() : found + closing.size();
}

/// Behind the '>' of a tag; those within quotes are none.
std::size_t end_of_tag(std::string_view text, std::size_t begin) {
  char quote = '\0';
  for (std::size_t i = begin; i < text.size(); ++i) {
    const char c = text[i];
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '>') {
      return i + 1;
    }
  }
  return text.size();
}

void list_elements(const tinyxml2::XMLElement& element,
                   std::vector<const tinyxml2::XMLElement*>& out) {
  out.push_back(&element);
  for (const auto* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement())
    list_elements(*child, out);
}

}  // namespace

std::vector<TagSpan> start_tags(std::string_view text) {
  std::vector<TagSpan> tags;
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const std::string_view rest = text.substr(at);
    if (rest.starts_with("<!--")) {
      at = behind(text, "-->", at + 4);
    } else if (rest.starts_with("<![CDATA[")) {
      at = behind(text, "]]>", at);
    } else if (rest.starts_with("<?")) {
      at = behind(text, "?>", at);
    } else if (rest.starts_with("<!") || rest.starts_with("</")) {
      at = behind(text, ">", at);
    } else {
      const std::size_t end = end_of_tag(text, at);
      tags.push_back({at, end});
      at = end;
    }
  }
  return tags;
}

std::map<const tinyxml2::XMLElement*, TagSpan> tags_of_elements(
    std::string_view text, const tinyxml2::XMLDocument& document) {
  std::vector<const tinyxml2::XMLElement*> elements;
  for (const auto* root = document.FirstChildElement(); root != nullptr;
       root = root->NextSiblingElement())
    list_elements(*root, elements);
  const std::vector<TagSpan> tags = start_tags(text);
  KINESCOPE_CHECK(tags.size() == elements.size(), "every element has its tag");
  std::map<const tinyxml2::XMLElement*, TagSpan> out;
  for (std::size_t i = 0; i < tags.size(); ++i) out.emplace(elements[i], tags[i]);
  return out;
}

std::string with_changes(std::string_view text, std::vector<TextChange> changes) {
  std::ranges::stable_sort(changes, {}, &TextChange::begin);
  std::string out;
  std::size_t at = 0;
  for (const TextChange& change : changes) {
    KINESCOPE_CHECK(change.begin >= at && change.end >= change.begin, "changes do not overlap");
    out += text.substr(at, change.begin - at);
    out += change.text;
    at = change.end;
  }
  out += text.substr(at);
  return out;
}

}  // namespace kinescope::urdf_document
