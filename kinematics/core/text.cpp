// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/text.h"

#include <algorithm>
#include <cstddef>

namespace kinescope {
namespace {

/// Length of the valid UTF-8 sequence at `at` (RFC 3629), 0 where there is none.
std::size_t sequence_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) -> unsigned {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(at);
  if (first < 0x80U) return 1;
  const std::size_t length = first >= 0xF0U ? 4 : first >= 0xE0U ? 3 : 2;
  if (first < 0xC2U || first > 0xF4U) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) return 0;
  }
  const unsigned second = byte(at + 1);
  const bool overlong = (first == 0xE0U && second < 0xA0U) || (first == 0xF0U && second < 0x90U);
  const bool surrogate = first == 0xEDU && second > 0x9FU;
  const bool beyond = first == 0xF4U && second > 0x8FU;
  return overlong || surrogate || beyond ? 0 : length;
}

}  // namespace

std::string clean_text(std::string_view text) {
  std::string clean;
  clean.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = sequence_length(text, i);
    if (length == 0) {
      clean += "\xEF\xBF\xBD";
      ++i;
      continue;
    }
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool control = byte < 0x20U || byte == 0x7FU;
    if (control) {
      clean += ' ';
    } else {
      clean += text.substr(i, length);
    }
    i += length;
  }
  return clean;
}

void append_unsaid(std::vector<std::string>& said, const std::vector<std::string>& more) {
  for (const std::string& words : more)
    if (std::ranges::find(said, words) == said.end()) said.push_back(words);
}

}  // namespace kinescope
